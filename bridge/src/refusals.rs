//! Records that the broker refuses: those that it may take later are tried for a while.

use std::collections::HashMap;
use std::time::{Duration, Instant};

/// How long a record is tried that is refused for a reason that may pass, such as a quota. The others wait behind it.
const PATIENCE: Duration = Duration::from_secs(60);

/// A record that is dropped because the broker refuses it for good.
#[derive(Debug, PartialEq)]
pub struct Apart {
    /// Its key in the store.
    pub key: u64,
    /// The cell.
    pub place: usize,
    /// Why.
    pub why: String,
}

/// When each was refused first.
#[derive(Debug, Default)]
pub struct Refusals(HashMap<u64, Instant>);

impl Refusals {
    /// A record is refused now: whether that is for good.
    pub fn is_for_good(&mut self, key: u64, now: Instant) -> bool {
        let first = *self.0.entry(key).or_insert(now);
        now.saturating_duration_since(first) >= PATIENCE
    }

    /// It is tried no more.
    pub fn forget(&mut self, key: u64) {
        self.0.remove(&key);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_that_may_pass_has_a_minute_for_each_record() {
        let (mut refusals, start) = (Refusals::default(), Instant::now());
        assert!(!refusals.is_for_good(7, start));
        assert!(!refusals.is_for_good(7, start + PATIENCE - Duration::from_millis(1)));
        assert!(!refusals.is_for_good(8, start + PATIENCE));
        assert!(refusals.is_for_good(7, start + PATIENCE));
        refusals.forget(7);
        assert!(!refusals.is_for_good(7, start + PATIENCE));
    }
}
