use core::time::Duration;

use crate::error::ConfigError;
use crate::timing;

/// Settings of the workstation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WorkstationConfig {
    /// The pause between two display cycles after which it requests again without an answer. Above
    /// [`timing::CYCLE`]. Default: 2 s (§9.4; "about 5 seconds" in §10.5). [`Duration::MAX`] means never.
    pub pause: Duration,
    /// The time without a pose after which the picture is [stale](crate::WorkstationEvent::Stale), and without an answer
    /// after which a request is [missed](crate::WorkstationEvent::Missed). Above [`timing::CYCLE`]. Default: 1.5 s; the
    /// source gives none. [`Duration::MAX`] is never.
    pub stale_after: Duration,
    /// The longest time from an XOFF to the next request that is sent, if neither XON nor another XOFF comes. Above 0.
    /// Default: 5 s; the source gives none. A digit `3` with one corrupt bit is an XOFF, and would silence the workstation.
    /// [`Duration::MAX`] means never.
    pub max_hold: Duration,
    /// Whether the line returns the sent bytes, as adapters for two wires do. Off. Each request comes
    /// back first then, and is dropped; another byte is [`WorkstationEvent::Echo`](crate::WorkstationEvent::Echo), a
    /// collision. While it is off, the first request that comes back shows it: that is the same event, and from then on they
    /// are dropped.
    pub echo: bool,
    /// The rules of the machine, all of which are kept.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub rules: robot_session::end::Rules<Rule>,
}

robot_session::rules! {
    /// The rules of the workstation's machine.
    pub enum Rule for WorkstationConfig {
        /// The workstation sends the next request only after an answer.
        Credit,
        /// The workstation sends a request again after a pause.
        AskAgain,
        /// An undecodable line was the answer.
        CorruptIsAnswer,
        /// Noise was not the answer.
        NoiseIsNoAnswer,
        /// A picture without new poses becomes stale.
        Expire,
        /// The request and the picture that a connection's end ends are reported.
        ReportEnd,
        /// A connection begins with a credit.
        AskFirst,
        /// A request that is not answered is reported.
        ReportOverdue,
        /// A request without an answer is reported once, even if it is sent again after a pause.
        MissOnce,
        /// A late answer shows that the host is there.
        LateIsAlive,
        /// XOFF holds the next request.
        Hold,
        /// Another XOFF holds it for longer.
        Prolong,
        /// XON releases it.
        Resume,
        /// An XOFF, which may be noise, expires.
        EndHold,
        /// A connection begins without an XOFF.
        ForgetHold,
    }
}

impl WorkstationConfig {
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        let minimum = timing::CYCLE;
        if self.pause <= minimum {
            return Err(ConfigError::Pause { minimum, found: self.pause });
        }
        if self.stale_after <= minimum {
            return Err(ConfigError::StaleAfter { minimum, found: self.stale_after });
        }
        if self.max_hold.is_zero() {
            return Err(ConfigError::MaxHold);
        }
        Ok(())
    }
}

impl Default for WorkstationConfig {
    fn default() -> Self {
        Self {
            pause: Duration::from_secs(2),
            stale_after: Duration::from_millis(1500),
            max_hold: Duration::from_secs(5),
            echo: false,
            #[cfg(feature = "model")]
            rules: robot_session::end::Rules::ALL,
        }
    }
}
