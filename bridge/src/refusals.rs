//! Records that the broker refuses: those that it may take later are retried for a while.

use std::collections::HashMap;
use std::time::{Duration, Instant};

/// The time for which a record is retried if the reason of its refusal may pass, such as a quota. The records after it wait.
const GIVE_UP_AFTER: Duration = Duration::from_secs(60);

/// A record that is dropped because the broker refuses it for good.
#[derive(Debug, PartialEq)]
pub struct DroppedRecord {
    /// The key of the record in the store.
    pub key: u64,
    /// The index of the cell.
    pub place: usize,
    /// The reason of the refusal.
    pub why: String,
}

/// The time at which each record was refused first.
#[derive(Debug, Default)]
pub struct Refusals(HashMap<u64, Instant>);

impl Refusals {
    /// Records that a record is refused now; returns whether that is for good.
    pub fn is_for_good(&mut self, key: u64, now: Instant) -> bool {
        let first = *self.0.entry(key).or_insert(now);
        now.saturating_duration_since(first) >= GIVE_UP_AFTER
    }

    /// Forgets a record, which is not tried any more.
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
        assert!(!refusals.is_for_good(7, start + GIVE_UP_AFTER - Duration::from_millis(1)));
        assert!(!refusals.is_for_good(8, start + GIVE_UP_AFTER));
        assert!(refusals.is_for_good(7, start + GIVE_UP_AFTER));
        refusals.forget(7);
        assert!(!refusals.is_for_good(7, start + GIVE_UP_AFTER));
    }
}
