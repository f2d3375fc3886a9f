//! The settings of the link's ends.

use isra_ball::{BallConfig, timing};

use cellwire_links::settings::{Configure, Fields, LINE};

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
    fn configure(&mut self, fields: &mut impl Fields) {
        let Self { config, baud } = self;
        fields.baud(LINE, baud);
        config.configure(fields);
    }
}
