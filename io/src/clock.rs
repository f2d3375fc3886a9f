//! The clock of a run.

use std::time::{Duration, Instant};

/// The time since the start of a run, the same for all its parts.
#[derive(Debug, Clone, Copy)]
pub struct Clock(Instant);

impl Clock {
    /// A clock that begins now.
    pub fn start() -> Self {
        Self(Instant::now())
    }

    /// The time since then.
    pub fn now(self) -> Duration {
        self.0.elapsed()
    }
}
