use crate::dialect::Dialect;
use crate::error::ConfigError;
use crate::message::ErrorCode;

/// What the source leaves open at the device's end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeviceConfig {
    /// What is accepted of commands. Default: [`Dialect::STRICT`].
    pub accepts: Dialect,
    /// How replies are written: each reading that is on is written instead of the source's own. Default: [`Dialect::STRICT`].
    pub writes: Dialect,
    /// The error number of what the protocol itself refuses: an unknown or malformed command, a motion that is not possible
    /// now. Any but 0 that fits its field. Default: [`ErrorCode::Generic`], 1.
    pub refusal: ErrorCode,
    /// The rule that the machine is to do without. For the model's must-fail cases only.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub without: Option<DeviceRule>,
}

/// A rule of the machine that no other setting takes out.
#[doc(hidden)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DeviceRule {
    /// A new connection takes the place of the one before, and gets none of its replies.
    TakeOver,
    /// The owner accepts the order that is pending, and no other.
    AcceptPending,
    /// What has become impossible since it was asked for is refused, also when the owner accepts it.
    AcceptPossible,
    /// One motion at a time.
    OneMotion,
    /// A motion needs the servo motors on.
    ServoFirst,
}

impl DeviceConfig {
    /// The documented defaults.
    pub const DEFAULT: Self = Self {
        accepts: Dialect::STRICT,
        writes: Dialect::STRICT,
        refusal: ErrorCode::Generic,
        #[cfg(feature = "model")]
        without: None,
    };

    pub(super) fn check(&self) -> Result<(), ConfigError> {
        if self.refusal.has_form(&self.writes) { Ok(()) } else { Err(ConfigError::Refusal) }
    }

    #[cfg(feature = "model")]
    pub(super) fn keeps(&self, rule: DeviceRule) -> bool {
        self.without != Some(rule)
    }

    #[cfg(not(feature = "model"))]
    #[expect(clippy::unused_self, reason = "only the model takes rules out")]
    pub(super) const fn keeps(&self, _: DeviceRule) -> bool {
        true
    }
}

impl Default for DeviceConfig {
    fn default() -> Self {
        Self::DEFAULT
    }
}
