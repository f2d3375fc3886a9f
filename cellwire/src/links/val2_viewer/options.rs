//! The settings of the link's ends.

use val2_viewer::{WorkstationConfig, timing};

use cellwire_links::settings::{Configure, Fields, LINE};

/// The simulated workstation.
#[derive(Debug, Clone, Copy)]
pub struct ViewerSettings {
    /// Its session.
    pub config: WorkstationConfig,
    /// Its line.
    pub baud: u32,
}

impl Default for ViewerSettings {
    fn default() -> Self {
        Self { config: WorkstationConfig::default(), baud: timing::BAUD }
    }
}

impl Configure for ViewerSettings {
    fn configure(&mut self, fields: &mut impl Fields) {
        let Self { config, baud } = self;
        fields.baud(LINE, baud);
        config.configure(fields);
    }
}
