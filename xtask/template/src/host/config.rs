use core::time::Duration;

use crate::error::ConfigError;

/// The configuration of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HostConfig {
    /// The longest time of a reply, above 0. Default: 1 s. [`Duration::MAX`]: no limit.
    pub timeout: Duration,
    /// The rules of the machine, all of which are kept.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub rules: robot_session::end::Rules<Rule>,
}

robot_session::rules! {
    /// The rules of the host's machine.
    pub enum Rule for HostConfig {
        /// The value of another register is not a reply.
        MatchRegister,
    }
}

impl HostConfig {
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        if self.timeout.is_zero() { Err(ConfigError::Timeout) } else { Ok(()) }
    }
}

impl Default for HostConfig {
    fn default() -> Self {
        Self {
            timeout: Duration::from_secs(1),
            #[cfg(feature = "model")]
            rules: robot_session::end::Rules::ALL,
        }
    }
}
