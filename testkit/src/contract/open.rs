//! The items that an end has begun and not ended.

use cellwire_links::end::{Act, PairedItem, PendingLimit};

/// The number of open items of each kind.
#[derive(Debug, Default)]
pub(super) struct OpenItems {
    once: &'static [PairedItem],
    open: Vec<u64>,
}

impl OpenItems {
    pub(super) fn new(once: &'static [PairedItem]) -> Self {
        Self { once, open: vec![0; once.len()] }
    }

    /// Records that an event has happened this often.
    pub(super) fn note(&mut self, happened: Act<'_>, times: u64) {
        for (once, open) in self.once.iter().zip(&mut self.open) {
            let times = if once.room == PendingLimit::Merged { 1 } else { times };
            let ends = once.ends.contains(&happened);
            let ends_all = match happened {
                Act::Event(name) => once.ends.contains(&Act::All(name)),
                happened => ends && happened == Act::Connection,
            };
            if ends_all {
                *open = 0;
            } else if ends {
                assert!(*open >= times, "{happened:?}, of {open} that have begun: {once:?}");
                *open -= times;
            }
            let is_silent = once.room != PendingLimit::Silent || happened != Act::Sent;
            assert!(is_silent || *open == 0, "something is sent before the end: {once:?}");
            if once.begins == happened {
                *open += times;
                match once.room {
                    PendingLimit::Merged => *open = 1,
                    PendingLimit::Most(most) => assert!(*open <= most, "{open} at a time: {once:?}"),
                    PendingLimit::Silent => assert!(*open == 1, "{open} at a time: {once:?}"),
                }
            }
        }
    }
}
