//! The configurations of both ends, field by field.

use robot_session::spec::{ANY_TIME, Configure, FieldVisitor, LINE};

use crate::ball::BallConfig;
use crate::host::HostConfig;

impl Configure for BallConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self {
            sensor_type,
            sensor,
            echo,
            #[cfg(feature = "model")]
                rules: _,
        } = self;
        fields.source("§4.2").whole("sensor_type", 0..=7, "", "the type in every packet", sensor_type);
        fields.source("§4.2").whole("sensor", 0..=7, "", "the number in every packet", sensor);
        fields.echo(echo);
    }
}

impl Configure for HostConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self {
            baud,
            period,
            max_delay,
            max_age,
            echo,
            #[cfg(feature = "model")]
                rules: _,
        } = self;
        fields.source("§4.1").baud(LINE, baud);
        let about =
            "the shortest time between polls; at least an exchange, rounded up to 1 ms: 14 ms at 9600 baud";
        fields.source("§3.4").time("period", ANY_TIME, about, period);
        let about =
            "assumed: the longest delay of a packet by ball, line and driver, without its transmission time";
        fields.time("max_delay", ANY_TIME, about, max_delay);
        let about = "the age at which values are stale; above 2 · max(period, window) + window, where window is an exchange and max_delay";
        fields.time("max_age", ANY_TIME, about, max_age);
        fields.echo(echo);
    }
}

#[cfg(feature = "settings")]
robot_session::deserialize!(BallConfig, BallConfig::default());
#[cfg(feature = "settings")]
robot_session::deserialize!(HostConfig, HostConfig::default());
