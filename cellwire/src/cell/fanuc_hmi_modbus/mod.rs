//! FANUC telemetry: a logger, the robot that runs a program of splines, and the comparison of the two.

mod demo;
pub mod logger;
pub mod path;
pub mod plausibility;
pub mod plot;
pub mod recording;
mod robot;
mod settings;
pub mod task;

pub use demo::demo;
pub use settings::Settings;
