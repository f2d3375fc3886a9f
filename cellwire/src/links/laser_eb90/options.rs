//! The settings of the link: its frames, and both ends.

use std::time::Duration;

use laser_eb90::{ControllerConfig, timing};

use cellwire_links::settings::{Configure, Fields, LINE};

/// The simulated controller.
#[derive(Debug, Clone, Copy)]
pub struct LaserSettings {
    /// Its session.
    pub config: ControllerConfig,
    /// Its line.
    pub baud: u32,
    /// How many instructions its queue holds.
    pub queue: usize,
    /// How long an instruction takes to execute.
    pub execution: Duration,
}

impl Default for LaserSettings {
    fn default() -> Self {
        let (config, execution) = (ControllerConfig::default(), Duration::from_millis(20));
        Self { config, baud: timing::BAUD, queue: 64, execution }
    }
}

impl Configure for LaserSettings {
    fn configure(&mut self, fields: &mut impl Fields) {
        let Self { config, baud, queue, execution } = self;
        fields.baud(LINE, baud);
        fields.whole("queue", 1..=9999, "instructions", "how many the queue holds", queue);
        let hour = Duration::ZERO..=Duration::from_secs(3600);
        fields.time("execution", hour, "how long an instruction takes", execution);
        config.configure(fields);
    }
}
