//! The configurations of both ends, field by field.

use core::time::Duration;

use robot_session::spec::{Configure, Fields, SOME_TIME};

use crate::host::HostConfig;
use crate::timing;
use crate::workstation::WorkstationConfig;

impl Configure for WorkstationConfig {
    fn configure(&mut self, fields: &mut impl Fields) {
        let Self { pause, stale_after, rules: _ } = self;
        let above = timing::CYCLE + Duration::from_nanos(1)..=Duration::MAX;
        let about =
            "without an answer for so long, the operator pauses the picture and it is asked for again";
        fields.source("§9.4").time("pause", above.clone(), about, pause);
        let about = "without a pose for so long the picture is stale";
        fields.time("stale_after", above, about, stale_after);
    }
}

impl Configure for HostConfig {
    fn configure(&mut self, fields: &mut impl Fields) {
        let Self { interval, max_age, format: _, rules: _ } = self;
        fields.time("interval", SOME_TIME, "the least from one pose to the next", interval);
        fields.time("max_age", SOME_TIME, "an older pose is not sent", max_age);
        let about = "what a packet looks like";
        fields.source("§5").code("format", "pose, or a format of the caller's", "pose", about);
    }
}
