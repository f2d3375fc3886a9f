//! How the controller behaves.

use core::time::Duration;

use crate::error::ConfigError;
use crate::profile::Profile;
use crate::timing;
use crate::words::Words;

/// How the controller behaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ControllerConfig {
    /// How frames are written.
    pub profile: Profile,
    /// Command words and error codes.
    pub words: Words,
    /// The most instructions that a frame may hold. Default: 7 (§3(6)); at least 1.
    pub batch: u8,
    /// The controller's cycle, at whose end answers are sent. Default: 16 ms (§4.1).
    pub tick: Duration,
    /// How long no byte must come before corrupt bytes are answered and an incomplete frame is dropped. Default: 50 ms. A PC
    /// that pauses longer within a frame gets an error code for each half.
    pub silence: Duration,
    /// The rule that the machine leaves out: for the model, which shows that it is needed.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub without: Option<ControllerRule>,
}

/// A rule of the controller that no setting takes out: for the model.
#[doc(hidden)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ControllerRule {
    /// Bytes that are too few for a frame are not answered.
    IgnoreShort,
}

impl ControllerConfig {
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        if self.batch == 0 { Err(ConfigError::NoBatch) } else { Ok(()) }
    }

    #[cfg(feature = "model")]
    pub(crate) fn keeps(&self, rule: ControllerRule) -> bool {
        self.without != Some(rule)
    }

    #[cfg(not(feature = "model"))]
    pub(crate) const fn keeps(&self, _: ControllerRule) -> bool {
        true
    }
}

impl Default for ControllerConfig {
    fn default() -> Self {
        Self {
            profile: Profile::default(),
            words: Words::default(),
            batch: 7,
            tick: timing::TICK,
            silence: Duration::from_millis(50),
            #[cfg(feature = "model")]
            without: None,
        }
    }
}
