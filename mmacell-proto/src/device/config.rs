use crate::dialect::Dialect;
use crate::error::ConfigError;
use crate::message::ErrorCode;

/// The configuration of a device's end: the details that the source leaves open.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeviceConfig {
    /// The readings that are accepted in commands. Default: [`Dialect::STRICT`].
    pub accepts: Dialect,
    /// The form of replies: each reading that is on is written instead of the source's own. Default:
    /// [`Dialect::STRICT`].
    pub writes: Dialect,
    /// The error number of commands that the protocol itself refuses: an unknown or malformed command, or a motion that is
    /// not possible now. Any number except 0 that fits its field. Default: [`ErrorCode::Generic`], 1.
    pub refusal: ErrorCode,
    /// The rules of the machine, all of which are kept.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub rules: robot_session::end::Rules<Rule>,
}

robot_session::rules! {
    /// The rules of the machine that are independent of other settings.
    pub enum Rule for DeviceConfig {
        /// A new connection replaces the previous one, and gets none of its replies.
        TakeOver,
        /// The owner accepts the order that is pending, and no other.
        AcceptPending,
        /// An order that has become impossible since the request is refused, even if the owner accepts it.
        AcceptPossible,
        /// One motion at a time.
        OneMotion,
        /// A motion needs the servo motors on.
        ServoFirst,
    }
}

impl DeviceConfig {
    /// The documented defaults.
    pub const DEFAULT: Self = Self {
        accepts: Dialect::STRICT,
        writes: Dialect::STRICT,
        refusal: ErrorCode::Generic,
        #[cfg(feature = "model")]
        rules: robot_session::end::Rules::ALL,
    };

    pub(super) fn check(&self) -> Result<(), ConfigError> {
        if self.refusal.has_form(&self.writes) { Ok(()) } else { Err(ConfigError::Refusal) }
    }
}

impl Default for DeviceConfig {
    fn default() -> Self {
        Self::DEFAULT
    }
}
