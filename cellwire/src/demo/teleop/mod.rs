//! The teleoperation cell, seen from each of its links.

mod ball;
pub mod cell;
pub mod cycles;
mod plot;
mod robot;
mod viewer;

use anyhow::Result;

use self::cell::{CellConfig, CellRecord};
use crate::demo::DemoOptions;
use crate::report::Report;

pub use ball::{Settings as BallSettings, demo as ball};
pub use robot::{Settings as RobotSettings, demo as robot};
pub use viewer::{Settings as ViewerSettings, demo as viewer};

/// Runs the cell once, and judges it as each of its links is.
///
/// # Errors
/// If there are no pseudo-terminals.
pub fn all(options: &DemoOptions) -> Result<[Report; 3]> {
    let config = CellConfig::default();
    let record = run(&config, options)?;
    Ok([robot::report(&config, &record), viewer::report(&record), ball::report(&config, &record)])
}

/// Runs the cell, and draws what the arm did.
fn run(config: &CellConfig, options: &DemoOptions) -> Result<CellRecord> {
    let record = cell::run(config, options)?;
    plot::write(options, config, &record)?;
    Ok(record)
}
