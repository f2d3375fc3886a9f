//! The configurations of both ends, by field.

use crate::settings::{Configure, SOME_TIME, Table};
use std::time::Duration;
use val2_viewer::{HostConfig, WorkstationConfig, timing};

impl Configure for WorkstationConfig {
    fn configure(&mut self, table: &mut Table<'_>) {
        let above = timing::CYCLE + Duration::from_nanos(1)..=Duration::MAX;
        let about =
            "without an answer for so long, the operator pauses the picture and it is asked for again";
        table.time("pause", above.clone(), about, &mut self.pause);
        let about = "without a pose for so long the picture is stale";
        table.time("stale_after", above, about, &mut self.stale_after);
    }
}

impl Configure for HostConfig {
    fn configure(&mut self, table: &mut Table<'_>) {
        table.time("interval", SOME_TIME, "the least from one pose to the next", &mut self.interval);
        table.time("max_age", SOME_TIME, "an older pose is not sent", &mut self.max_age);
    }
}
