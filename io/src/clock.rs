//! The clock of a run.

use std::time::{Duration, Instant};

/// The time since the start of a run, the same for all its parts.
#[derive(Debug, Clone, Copy)]
pub struct Clock(Instant);

impl Clock {
    /// Starts a clock at zero.
    pub fn start() -> Self {
        Self(Instant::now())
    }

    /// Returns the time since the start.
    pub fn now(self) -> Duration {
        self.0.elapsed()
    }
}
