//! The settings of the link's ends.

use isra_ball::{BallConfig, timing};

use cellwire_links::settings::{Configure, Table};

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
