use crate::error::ConfigError;
use crate::keys::Keys;
use crate::message::{Packet, Status};

/// The configuration of a ball.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BallConfig {
    /// Sensor type, 0..=7. Default: 0.
    pub sensor_type: u8,
    /// Sensor number, 0..=7. Default: 0.
    pub sensor: u8,
    /// Whether the line returns the sent bytes, as adapters for two wires do. Off. The bytes of a packet come back first
    /// then: they are compared with it and dropped, and others are [`BallEvent::Echo`](crate::BallEvent::Echo), a collision.
    /// While it is off, the first packet that comes back shows it: that is the same event, and from then on they are dropped.
    pub echo: bool,
    /// The rules of the machine, all of which are kept.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub rules: robot_session::end::Rules<Rule>,
}

robot_session::rules! {
    /// The rules of the ball's machine.
    pub enum Rule for BallConfig {
        /// Values that were sent are old.
        MarkOld,
        /// A poll of one connection is not answered on the next.
        ForgetPoll,
    }
}

impl BallConfig {
    /// Returns a packet of a ball at rest that has not measured anything.
    pub(crate) fn packet(&self) -> Result<Packet, ConfigError> {
        let Self { sensor_type, sensor, .. } = *self;
        let (force, moment) = ([0; 3], [0; 3]);
        let packet = Packet { sensor_type, sensor, status: Status::Old, force, moment, keys: Keys::NONE };
        packet.to_bytes().map(|_| packet).map_err(ConfigError::Identity)
    }
}
