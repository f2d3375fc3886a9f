//! The lease of this bridge on shared cells. A cell's task checks it before each action.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use robot_session::now;

/// The time until which the cells are this bridge's, by this process's clock.
#[derive(Debug, Default)]
pub struct Lease(AtomicU64);

impl Lease {
    /// Returns whether the cells are this bridge's at this moment.
    pub fn holds(&self) -> bool {
        self.holds_at(now())
    }

    /// Returns whether the cells are this bridge's at another moment.
    pub fn holds_at(&self, now: Duration) -> bool {
        now < Duration::from_micros(self.0.load(Ordering::Relaxed))
    }

    /// Returns the time until the lease ends.
    pub fn left(&self) -> Duration {
        Duration::from_micros(self.0.load(Ordering::Relaxed)).saturating_sub(now())
    }

    /// Sets the end of the lease.
    pub fn renew(&self, until: Duration) {
        self.0.store(u64::try_from(until.as_micros()).unwrap_or(u64::MAX), Ordering::Relaxed);
    }
}
