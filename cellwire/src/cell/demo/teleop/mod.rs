//! The teleoperation cell, seen from each of its links.

mod ball;
pub mod cell;
pub mod cycles;
mod plot;
mod robot;
mod viewer;

pub use ball::{Settings as BallSettings, demo as ball};
pub use robot::{Settings as RobotSettings, demo as robot};
pub use viewer::{Settings as ViewerSettings, demo as viewer};
