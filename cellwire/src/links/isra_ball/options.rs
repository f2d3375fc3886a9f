//! The settings of the link's ends.

use isra_ball::{BallConfig, HostConfig, timing};

use crate::links::settings::{ANY_TIME, Configure, Table};

/// The simulated ball.
#[derive(Debug, Clone, Copy)]
pub struct BallSettings {
    /// Its session.
    pub config: BallConfig,
    /// Its line.
    pub baud: u32,
}

impl Default for BallSettings {
    fn default() -> Self {
        Self { config: BallConfig::default(), baud: timing::BAUD }
    }
}

impl Configure for BallSettings {
    fn configure(&mut self, table: &mut Table<'_>) {
        let Self { config, baud } = self;
        table.baud(baud);
        config.configure(table);
    }
}

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
