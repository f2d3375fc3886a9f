//! The items that an end has begun and not ended.

use cellwire_links::end::{By, Once, Room};

/// The number of open items of each kind.
#[derive(Debug, Default)]
pub(super) struct Open {
    once: &'static [Once],
    open: Vec<u64>,
}

impl Open {
    pub(super) fn new(once: &'static [Once]) -> Self {
        Self { once, open: vec![0; once.len()] }
    }

    /// Records that an event has happened this often.
    pub(super) fn note(&mut self, happened: By<'_>, times: u64) {
        for (once, open) in self.once.iter().zip(&mut self.open) {
            let times = if once.room == Room::Merged { 1 } else { times };
            let ends = once.ends.contains(&happened);
            let ends_all = match happened {
                By::Event(name) => once.ends.contains(&By::All(name)),
                happened => ends && happened == By::Connection,
            };
            if ends_all {
                *open = 0;
            } else if ends {
                assert!(*open >= times, "{happened:?}, of {open} that have begun: {once:?}");
                *open -= times;
            }
            let is_silent = once.room != Room::Silent || happened != By::Sent;
            assert!(is_silent || *open == 0, "something is sent before the end: {once:?}");
            if once.begins == happened {
                *open += times;
                match once.room {
                    Room::Merged => *open = 1,
                    Room::Most(most) => assert!(*open <= most, "{open} at a time: {once:?}"),
                    Room::Silent => assert!(*open == 1, "{open} at a time: {once:?}"),
                }
            }
        }
    }
}
