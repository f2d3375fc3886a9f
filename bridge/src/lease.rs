//! The time until which cells that several bridges share are this one's. A cell's task looks at it before it does anything.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use robot_session::now;

/// Until when, by this process's clock.
#[derive(Debug, Default)]
pub struct Lease(AtomicU64);

impl Lease {
    /// Whether the cells are this bridge's at this moment.
    pub fn holds(&self) -> bool {
        self.holds_at(now())
    }

    /// Whether they are at another.
    pub fn holds_at(&self, now: Duration) -> bool {
        now < Duration::from_micros(self.0.load(Ordering::Relaxed))
    }

    /// The time until they are not, by this lease.
    pub fn left(&self) -> Duration {
        Duration::from_micros(self.0.load(Ordering::Relaxed)).saturating_sub(now())
    }

    /// They are until then.
    pub fn renew(&self, until: Duration) {
        self.0.store(u64::try_from(until.as_micros()).unwrap_or(u64::MAX), Ordering::Relaxed);
    }
}
