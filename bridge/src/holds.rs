//! Cells whose topics the broker refuses, as a wrong access control does: their records wait in the store, and one of them
//! is tried each minute until it is taken.

use std::collections::{BTreeSet, HashMap};
use std::time::{Duration, Instant};

/// The time from one trial to the next.
const INTERVAL: Duration = Duration::from_secs(60);

/// The cells that are held, by their places.
#[derive(Debug, Default)]
pub struct Holds(HashMap<usize, Hold>);

#[derive(Debug)]
struct Hold {
    /// The cell's records that wait.
    keys: BTreeSet<u64>,
    /// The record that is on its way as a trial.
    trial: Option<u64>,
    try_at: Instant,
}

/// The meaning of a refused record.
#[derive(Debug, PartialEq, Eq)]
pub enum RefusedRecord {
    /// The record's cell is held from now on.
    Begins,
    /// The record was the trial.
    Trial,
    /// The record was on its way when the cell's first one was refused.
    Another,
}

impl Holds {
    /// Records that a cell's record was refused because of its topic.
    pub fn refuse(&mut self, place: usize, key: u64, now: Instant) -> RefusedRecord {
        let mut refused = RefusedRecord::Another;
        let hold = self.0.entry(place).or_insert_with(|| {
            refused = RefusedRecord::Begins;
            Hold { keys: BTreeSet::new(), trial: None, try_at: now + INTERVAL }
        });
        if hold.trial.take_if(|trial| *trial == key).is_some() {
            hold.try_at = now + INTERVAL;
            refused = RefusedRecord::Trial;
        } else {
            hold.keys.insert(key);
        }
        refused
    }

    /// Records that a cell's record was taken. If it was the trial, the cell is held no longer: returns its other records.
    pub fn take(&mut self, place: usize, key: u64) -> Option<BTreeSet<u64>> {
        if self.0.get(&place)?.trial != Some(key) {
            return None;
        }
        let Hold { mut keys, .. } = self.0.remove(&place)?;
        keys.remove(&key);
        Some(keys)
    }

    /// Returns whether the cell is held.
    pub fn is_held(&self, place: usize) -> bool {
        self.0.contains_key(&place)
    }

    /// Returns the number of the cell's records that wait because it is held.
    pub fn count(&self, place: usize) -> usize {
        self.0.get(&place).map_or(0, |hold| hold.keys.len())
    }

    /// Keeps a record that would be published now, if its cell is held. Returns whether it is.
    pub fn keep(&mut self, place: usize, key: u64) -> bool {
        self.0.get_mut(&place).map(|hold| hold.keys.insert(key)).is_some()
    }

    /// Drops the keys below this one: the store does not have their records any more.
    pub fn made_room(&mut self, first: u64) {
        for hold in self.0.values_mut() {
            while hold.keys.first().is_some_and(|key| *key < first) {
                hold.keys.pop_first();
            }
        }
    }

    /// Forgets a record that is dropped.
    pub fn forget(&mut self, place: usize, key: u64) {
        if let Some(hold) = self.0.get_mut(&place) {
            hold.keys.remove(&key);
            hold.trial.take_if(|trial| *trial == key);
        }
    }

    /// Called when there is a new connection: each cell is tried at once.
    pub fn connected(&mut self, now: Instant) {
        for hold in self.0.values_mut() {
            (hold.trial, hold.try_at) = (None, now);
        }
    }

    /// Returns a record to try, and the place of its cell.
    pub fn due(&self, now: Instant) -> Option<(usize, u64)> {
        let due = self.0.iter().filter(|(_, hold)| hold.trial.is_none() && hold.try_at <= now);
        due.filter_map(|(place, hold)| Some((*place, *hold.keys.first()?))).min()
    }

    /// Records that a record is on its way as a trial.
    pub fn tried(&mut self, place: usize, key: u64) {
        if let Some(hold) = self.0.get_mut(&place) {
            hold.trial = Some(key);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_is_tried_each_minute_until_it_is_taken() {
        let (mut holds, start) = (Holds::default(), Instant::now());
        assert!(!holds.keep(3, 6) && !holds.is_held(3));
        assert_eq!(holds.refuse(3, 7, start), RefusedRecord::Begins);
        assert_eq!(holds.refuse(3, 9, start), RefusedRecord::Another);
        assert!(holds.keep(3, 20) && holds.keep(3, 20) && !holds.keep(4, 21));
        assert_eq!((holds.count(3), holds.count(4)), (3, 0));
        assert_eq!(holds.due(start + INTERVAL - Duration::from_millis(1)), None);
        let first = start + INTERVAL;
        assert_eq!(holds.due(first), Some((3, 7)));
        holds.tried(3, 7);
        assert_eq!(holds.due(first + INTERVAL), None, "one at a time");
        // A record that was on its way when the first was refused, and was taken, shows nothing about those before it.
        assert_eq!(holds.take(3, 8), None);
        assert_eq!(holds.refuse(3, 7, first), RefusedRecord::Trial);
        assert_eq!(holds.due(first + INTERVAL - Duration::from_millis(1)), None);
        holds.tried(3, 7);
        assert_eq!(holds.take(3, 7), Some(BTreeSet::from([9, 20])));
        assert!(!holds.is_held(3));
        assert_eq!(holds.take(3, 7), None);
        assert_eq!(holds.refuse(3, 22, first), RefusedRecord::Begins);
    }

    #[test]
    fn a_new_connection_tries_at_once_and_what_is_dropped_is_not_tried() {
        let (mut holds, now) = (Holds::default(), Instant::now());
        holds.refuse(3, 7, now);
        holds.refuse(1, 9, now);
        holds.keep(3, 8);
        holds.tried(3, 7);
        holds.connected(now);
        assert_eq!(holds.due(now), Some((1, 9)));
        holds.tried(1, 9);
        assert_eq!(holds.due(now), Some((3, 7)));
        holds.tried(3, 7);
        holds.forget(3, 7);
        assert_eq!(holds.due(now), Some((3, 8)));
        holds.made_room(9);
        assert_eq!((holds.count(3), holds.count(1), holds.due(now)), (0, 1, None));
        assert!(holds.keep(3, 10));
        assert_eq!(holds.due(now), Some((3, 10)));
    }
}
