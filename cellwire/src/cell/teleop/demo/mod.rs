//! The teleoperation cell, seen from each of its links.

mod ball;
mod plot;
mod robot;
mod viewer;

pub use ball::demo as ball;
pub use robot::demo as robot;
pub use viewer::demo as viewer;
