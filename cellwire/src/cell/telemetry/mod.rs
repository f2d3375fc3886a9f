//! FANUC telemetry: what logs it, the program that was to be run, and the comparison of the two.

pub mod logger;
pub mod path;
pub mod plausibility;
pub mod plot;
pub mod recording;
pub mod task;
