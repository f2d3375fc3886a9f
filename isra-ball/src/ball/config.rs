use crate::error::ConfigError;
use crate::keys::Keys;
use crate::message::{Packet, Status};

/// Which ball it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BallConfig {
    /// Sensor type, 0..=7. Default: 0.
    pub sensor_type: u8,
    /// Sensor number, 0..=7. Default: 0.
    pub sensor: u8,
    /// A rule that the machine leaves out: for the model, which shows what each rule is for.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub without: Option<Rule>,
}

/// The rules of the ball's machine.
#[doc(hidden)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Rule {
    /// Values that were sent are old.
    MarkOld,
    /// A poll of one connection is not answered on the next.
    ForgetPoll,
}

impl BallConfig {
    /// A packet of a ball at rest that has measured nothing.
    pub(crate) fn packet(&self) -> Result<Packet, ConfigError> {
        let Self { sensor_type, sensor, .. } = *self;
        let (force, moment) = ([0; 3], [0; 3]);
        let packet = Packet { sensor_type, sensor, status: Status::Old, force, moment, keys: Keys::NONE };
        packet.to_bytes().map(|_| packet).map_err(ConfigError::Identity)
    }

    #[cfg(feature = "model")]
    pub(crate) fn keeps(&self, rule: Rule) -> bool {
        self.without != Some(rule)
    }

    #[cfg(not(feature = "model"))]
    #[expect(clippy::unused_self, reason = "with the feature `model` it has a rule left out")]
    pub(crate) const fn keeps(&self, _rule: Rule) -> bool {
        true
    }
}
