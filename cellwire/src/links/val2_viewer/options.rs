//! The settings of the link's ends.

use val2_viewer::{WorkstationConfig, timing};

use cellwire_links::settings::{Configure, Table};

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
    fn configure(&mut self, table: &mut Table<'_>) {
        let Self { config, baud } = self;
        table.baud(baud);
        config.configure(table);
    }
}
