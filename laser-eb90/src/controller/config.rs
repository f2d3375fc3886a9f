//! The configuration of the controller.

use core::time::Duration;

use crate::error::ConfigError;
use crate::profile::Profile;
use crate::timing;
use crate::words::Words;

/// Settings of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ControllerConfig {
    /// The profile by which frames are written.
    pub profile: Profile,
    /// Command words and error codes.
    pub words: Words,
    /// The maximum of instructions in a frame. Default: 7 (§3(6)); at least 1.
    pub batch: u8,
    /// The controller's cycle, at whose end answers are sent. Default: 16 ms (§4.1).
    pub tick: Duration,
    /// The silence after which corrupt bytes are answered and an incomplete frame is dropped. Default: 50 ms. A PC that
    /// pauses longer within a frame gets an error code for the bytes that it has sent, and none for the rest.
    pub silence: Duration,
    /// Whether the line returns the sent bytes, as adapters for two wires do. Off. The bytes of an answer come
    /// back first then: they are compared with it and dropped, and others are
    /// [`ControllerEvent::Echo`](crate::ControllerEvent::Echo), a collision. While it is off on such a line, each answer
    /// comes back as an instruction without parameters.
    pub echo: bool,
    /// The rules of the machine, all of which are kept.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub rules: robot_session::end::Rules<Rule>,
}

robot_session::rules! {
    /// The rules of the controller's machine that are independent of settings.
    pub enum Rule for ControllerConfig {
        /// Bytes that are too few for a frame are not answered.
        IgnoreShort,
        /// Bytes without a head, after an error code, are the rest of the answered frame.
        IgnoreRest,
        /// A frame after corrupt bytes is not executed before the line was silent.
        TrustSilence,
    }
}

impl ControllerConfig {
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        if self.batch == 0 { Err(ConfigError::NoBatch) } else { Ok(()) }
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
            echo: false,
            #[cfg(feature = "model")]
            rules: robot_session::end::Rules::ALL,
        }
    }
}
