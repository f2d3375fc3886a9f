//! FANUC telemetry: the logger, the path of the commanded program, and the comparison of the two.

pub mod logger;
pub mod path;
pub mod plot;
pub mod recording;
pub mod task;

/// Implausible telemetry was recorded.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Implausible(pub String);
