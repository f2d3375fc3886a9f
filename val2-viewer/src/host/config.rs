use core::time::Duration;

use robot_session::Encode as _;

use crate::error::ConfigError;
use crate::message::PosePacket;

/// Writes a packet into a buffer and returns its length; `None` if it does not fit, or nothing is to be sent.
pub type Format = fn(&PosePacket, &mut [u8]) -> Option<usize>;

/// Settings of the host.
#[derive(Debug, Clone, Copy)]
pub struct HostConfig {
    /// The shortest time between packets, and from the beginning of a connection to its first packet. Above 0. Default:
    /// 150 ms.
    ///
    /// All requests of this time have one answer: 288 of them come out of a serial driver at 19200 baud. A
    /// workstation, which draws for 200 ms, is never slowed down. [`Duration::MAX`] means never.
    pub interval: Duration,
    /// The maximum age of a pose that is sent. Above 0. Default: 200 ms, a display cycle: seven poses of ALTER.
    /// [`Duration::MAX`] means no limit.
    ///
    /// When ALTER has ended, the arm's position is unknown: requests then wait for a new pose. The source's host stops reading
    /// them (§9.4).
    pub max_age: Duration,
    /// The longest time from an XOFF to the next byte that is sent, if neither XON nor another XOFF comes. Above 0. Default:
    /// 5 s; the source gives none. A digit `3` with one corrupt bit is an XOFF, and would silence the line.
    /// [`Duration::MAX`] means never.
    pub max_hold: Duration,
    /// The format of a packet. Default: the line of [`PosePacket`], since the source does not describe its own format.
    ///
    /// Another format may write [`Host::MAX_TRANSMIT`](crate::Host) bytes. A packet with the bytes 11h or 13h in it,
    /// XON and XOFF, is [not sent](crate::HostEvent::Unsendable).
    pub format: Format,
    /// Whether the line returns the sent bytes, as adapters for two wires do. Off. The bytes of a packet come back first
    /// then: they are compared with it and dropped, and others are [`HostEvent::Echo`](crate::HostEvent::Echo), a collision.
    /// While it is off, the first packet that comes back shows it: that is the same event, and from then on they are dropped.
    pub echo: bool,
    /// The rules of the machine, all of which are kept.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub rules: robot_session::end::Rules<Rule>,
}

robot_session::rules! {
    /// The rules of the host's machine.
    pub enum Rule for HostConfig {
        /// The first packet of a connection waits for all accumulated requests.
        DrainFirst,
        /// Between two packets there is an interval.
        Pace,
        /// A pose that is too old is not sent.
        Expire,
        /// A request of one connection is not answered on the next.
        ForgetRequest,
        /// XOFF holds the next packet.
        Hold,
        /// XOFF again holds it for longer.
        Prolong,
        /// XON restarts the line.
        Resume,
        /// An XOFF, which may be noise, expires.
        EndHold,
        /// A connection begins without an XOFF.
        ForgetHold,
    }
}

impl HostConfig {
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        if self.interval.is_zero() {
            return Err(ConfigError::Interval);
        }
        if self.max_age.is_zero() {
            return Err(ConfigError::MaxAge);
        }
        if self.max_hold.is_zero() {
            return Err(ConfigError::MaxHold);
        }
        Ok(())
    }
}

impl Default for HostConfig {
    fn default() -> Self {
        Self {
            interval: Duration::from_millis(150),
            max_age: Duration::from_millis(200),
            max_hold: Duration::from_secs(5),
            format: |packet, out| packet.encode(out).ok(),
            echo: false,
            #[cfg(feature = "model")]
            rules: robot_session::end::Rules::ALL,
        }
    }
}
