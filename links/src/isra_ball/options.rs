//! The configurations of both ends, by field.

use crate::settings::{ANY_TIME, Configure, Table};
use isra_ball::{BallConfig, HostConfig};

impl Configure for BallConfig {
    fn configure(&mut self, table: &mut Table<'_>) {
        table.whole("sensor_type", 0..=7, "", "the type in every packet", &mut self.sensor_type);
        table.whole("sensor", 0..=7, "", "the number in every packet", &mut self.sensor);
    }
}

impl Configure for HostConfig {
    fn configure(&mut self, table: &mut Table<'_>) {
        table.baud(&mut self.baud);
        table.time(
            "period",
            ANY_TIME,
            "the least from poll to poll, above 13.54 ms at 9600 baud",
            &mut self.period,
        );
        let about =
            "assumed: the longest that ball, line and driver delay a packet beyond its time on the line";
        table.time("max_delay", ANY_TIME, about, &mut self.max_delay);
        let about = "older values are stale; above two periods and a reply window";
        table.time("max_age", ANY_TIME, about, &mut self.max_age);
    }
}
