//! The configurations of both ends, field by field.

use core::time::Duration;

use robot_session::spec::{Configure, FieldVisitor, SOME_TIME};

use crate::host::HostConfig;
use crate::timing;
use crate::workstation::WorkstationConfig;

const MAX_HOLD: &str = "how long an XOFF without a following XON or XOFF holds";

impl Configure for WorkstationConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self {
            pause,
            stale_after,
            max_hold,
            echo,
            #[cfg(feature = "model")]
                rules: _,
        } = self;
        let above = timing::CYCLE + Duration::from_nanos(1)..=Duration::MAX;
        let about = "the pause between two display cycles after which an unanswered request is repeated";
        fields.source("§9.4").time("pause", above.clone(), about, pause);
        let about = "the time without a pose after which the picture is stale and a request is missed";
        fields.time("stale_after", above, about, stale_after);
        fields.time("max_hold", SOME_TIME, MAX_HOLD, max_hold);
        fields.echo(echo);
    }
}

impl Configure for HostConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self {
            interval,
            max_age,
            max_hold,
            format: _,
            echo,
            #[cfg(feature = "model")]
                rules: _,
        } = self;
        fields.time("interval", SOME_TIME, "the shortest time between poses", interval);
        fields.time("max_age", SOME_TIME, "the oldest pose that is sent", max_age);
        fields.time("max_hold", SOME_TIME, MAX_HOLD, max_hold);
        let about = "the format of a packet";
        fields.source("§5").code("format", "pose, or a format of the caller's", "pose", about);
        fields.echo(echo);
    }
}

#[cfg(feature = "settings")]
robot_session::deserialize!(WorkstationConfig, WorkstationConfig::default());
#[cfg(feature = "settings")]
robot_session::deserialize!(HostConfig, HostConfig::default());
