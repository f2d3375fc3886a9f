//! The configurations of both ends, field by field.

use core::time::Duration;

use robot_session::spec::{Configure, Fields, SOME_TIME};

use crate::host::HostConfig;
use crate::timing;
use crate::workstation::WorkstationConfig;

const MAX_HOLD: &str = "an XOFF that neither XON nor XOFF follows holds the line for so long";

impl Configure for WorkstationConfig {
    fn configure(&mut self, fields: &mut impl Fields) {
        let Self { pause, stale_after, max_hold, rules: _ } = self;
        let above = timing::CYCLE + Duration::from_nanos(1)..=Duration::MAX;
        let about =
            "without an answer for so long, the operator pauses the picture and it is asked for again";
        fields.source("§9.4").time("pause", above.clone(), about, pause);
        let about = "without a pose for so long the picture is stale, and a request missed";
        fields.time("stale_after", above, about, stale_after);
        fields.time("max_hold", SOME_TIME, MAX_HOLD, max_hold);
    }
}

impl Configure for HostConfig {
    fn configure(&mut self, fields: &mut impl Fields) {
        let Self { interval, max_age, max_hold, format: _, rules: _ } = self;
        fields.time("interval", SOME_TIME, "the least from one pose to the next", interval);
        fields.time("max_age", SOME_TIME, "an older pose is not sent", max_age);
        fields.time("max_hold", SOME_TIME, MAX_HOLD, max_hold);
        let about = "what a packet looks like";
        fields.source("§5").code("format", "pose, or a format of the caller's", "pose", about);
    }
}

#[cfg(feature = "settings")]
robot_session::deserialize!(WorkstationConfig, WorkstationConfig::default());
#[cfg(feature = "settings")]
robot_session::deserialize!(HostConfig, HostConfig::default());
