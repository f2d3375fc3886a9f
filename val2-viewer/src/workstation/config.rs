use core::time::Duration;

use robot_session::Rules;

use crate::error::ConfigError;
use crate::timing;

/// When the workstation asks again, and when its picture is stale.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WorkstationConfig {
    /// The pause between two display cycles after which it asks again although no answer has come. Above
    /// [`timing::CYCLE`]. Default: 2 s (§9.4; "about 5 seconds" in §10.5). [`Duration::MAX`] is never.
    pub pause: Duration,
    /// Without a pose for so long, the picture is [stale](crate::WorkstationEvent::Stale). Above [`timing::CYCLE`]. Default: 1.5 s; the
    /// source gives none. [`Duration::MAX`] is never.
    pub stale_after: Duration,
    /// The rules of the machine, all of which are kept.
    #[doc(hidden)]
    pub rules: Rules<Rule>,
}

robot_session::rules! {
    /// The rules of the workstation's machine.
    pub enum Rule {
        /// It asks again only after an answer.
        Credit,
        /// It asks again after a pause.
        AskAgain,
        /// A line that cannot be read was the answer.
        CorruptIsAnswer,
        /// Noise that is no line was not the answer.
        NoiseIsNoAnswer,
        /// A picture without new poses becomes stale.
        Expire,
        /// What a connection's end ends is reported.
        ReportEnd,
        /// A connection begins with a credit.
        AskFirst,
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
        Ok(())
    }
}

impl Default for WorkstationConfig {
    fn default() -> Self {
        Self { pause: Duration::from_secs(2), stale_after: Duration::from_millis(1500), rules: Rules::ALL }
    }
}
