use core::time::Duration;

use crate::dialect::Dialect;
use crate::error::ConfigError;

/// Settings of the central controller's end that the source leaves open.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CentralConfig {
    /// The readings that are accepted in replies. Default: [`Dialect::STRICT`].
    pub accepts: Dialect,
    /// The form of commands: each reading that is on is written instead of the source's own. Default:
    /// [`Dialect::STRICT`].
    pub writes: Dialect,
    /// The longest time of a reply, from 1 ns; `Duration::MAX` means no timeout, and then a half-open connection is
    /// never noticed. The source says "immediately" (§3) and gives no figure. Default: 1 s.
    pub timeout: Duration,
    /// The time after the start of a motion for which a status may still be from before it: a report of rest is then
    /// ignored, unless the device has arrived. If a device takes longer to begin, its motion is reported as missed.
    /// Default: 100 ms.
    pub settle: Duration,
    /// The distance from the target that counts as arrived, in units of the last digit: 1 µm, 0.1 mrad. Default: 10.
    pub tolerance: u32,
    /// The rules of the machine, all of which are kept.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub rules: robot_session::end::Rules<Rule>,
}

robot_session::rules! {
    /// The rules of the machine that are independent of other settings.
    pub enum Rule for CentralConfig {
        /// A device has arrived only with its servo motors on.
        ServoOn,
        /// A command that was sent and not answered is unknown.
        UnknownWhenSent,
        /// The knowledge about a motion ends with its connection.
        ForgetMotion,
        /// A halt ends the motion's target.
        ForgetTarget,
        /// An abort after the command was sent ends the connection.
        AbortEnds,
        /// An unsolicited reply ends the connection.
        StrayEnds,
    }
}

impl CentralConfig {
    /// The documented defaults.
    pub const DEFAULT: Self = Self {
        accepts: Dialect::STRICT,
        writes: Dialect::STRICT,
        timeout: Duration::from_secs(1),
        settle: Duration::from_millis(100),
        tolerance: 10,
        #[cfg(feature = "model")]
        rules: robot_session::end::Rules::ALL,
    };

    pub(super) fn check(&self) -> Result<(), ConfigError> {
        if self.timeout.is_zero() { Err(ConfigError::Timeout) } else { Ok(()) }
    }
}

impl Default for CentralConfig {
    fn default() -> Self {
        Self::DEFAULT
    }
}
