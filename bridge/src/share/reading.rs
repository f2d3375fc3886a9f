//! The ledgers of other bridges, as far as they were read on this connection.

use std::collections::{BTreeMap, BTreeSet};

use super::message::Page;

/// The ledgers by node and store.
#[derive(Debug, Default)]
pub(super) struct Reading(BTreeMap<(String, String), Ledger>);

/// The pages of a ledger that were read.
#[derive(Debug, Default)]
struct Ledger {
    /// Whether the ledger was read on an earlier connection, when its bridge was dead.
    is_earlier: bool,
    /// The numbers of the first and the last page.
    bounds: Option<(u64, u64)>,
    read: BTreeSet<u64>,
    until: u64,
}

impl Ledger {
    fn is_read(&self) -> bool {
        self.bounds.is_some_and(|(first, last)| (first..last).all(|page| self.read.contains(&page)))
    }
}

impl Reading {
    /// Notes a page that was read.
    pub(super) fn read(&mut self, node: &str, store: &str, page: &Page) {
        let ledger = self.0.entry((node.to_owned(), store.to_owned())).or_default();
        if ledger.is_earlier {
            *ledger = Ledger::default();
        }
        ledger.read.insert(page.page);
        ledger.until = ledger.until.max(page.until);
        if let Some(first) = page.first {
            ledger.bounds = Some((first, page.page));
        }
    }

    /// Returns whether every ledger of a node is read, of which there is one at least: that of the store that the node has, if
    /// that is known.
    pub(super) fn is_read(&self, node: &str, store: Option<&str>) -> bool {
        let mut of = self.of(node).map(|(store, _)| store).peekable();
        let has_its = store.map_or(of.peek().is_some(), |store| of.any(|found| found == store));
        has_its && self.of(node).all(|(_, ledger)| ledger.is_read())
    }

    /// Returns the time of the latest command in the ledgers of a node.
    pub(super) fn until(&self, node: &str) -> u64 {
        self.of(node).map(|(_, ledger)| ledger.until).max().unwrap_or_default()
    }

    /// Returns whether a ledger of a node has an unread page.
    pub(super) fn has_gap(&self, node: &str) -> bool {
        self.of(node).any(|(_, ledger)| !ledger.is_read())
    }

    /// Called when a new connection is open: only the ledgers of nodes that were dead may be unchanged.
    pub(super) fn opened(&mut self, was_dead: impl Fn(&str) -> bool) {
        self.0.retain(|(node, _), _| was_dead(node));
        self.0.values_mut().for_each(|ledger| ledger.is_earlier = true);
    }

    /// Forgets the pages of these nodes that were read on earlier connections.
    pub(super) fn forget(&mut self, is_one: impl Fn(&str) -> bool) {
        self.0.retain(|(node, _), ledger| !ledger.is_earlier || !is_one(node));
    }

    fn of(&self, node: &str) -> impl Iterator<Item = (&str, &Ledger)> {
        let of = self.0.iter().filter(move |((found, _), _)| found == node);
        of.map(|((_, store), ledger)| (store.as_str(), ledger))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ledger_is_read_when_every_page_from_the_first_to_the_last_is() {
        let mut reading = Reading::default();
        let page = |page, first, until| Page { page, first, until, commands: Vec::new() };
        let known = |reading: &Reading| (reading.is_read("b", None), reading.is_read("b", Some("s")));
        assert_eq!(known(&reading), (false, false));
        reading.read("b", "s", &page(4, Some(2), 9));
        assert_eq!((known(&reading), reading.has_gap("b")), ((false, false), true));
        reading.read("b", "s", &page(3, None, 7));
        assert_eq!(known(&reading), (false, false));
        reading.read("b", "s", &page(2, None, 3));
        assert_eq!(
            (known(&reading), reading.until("b"), reading.is_read("a", None)),
            ((true, true), 9, false)
        );
        // The node has lost that store, and the ledger of another one is not there, or not all of it.
        assert!(!reading.is_read("b", Some("t")) && !reading.has_gap("b"));
        reading.read("b", "t", &page(1, Some(0), 1));
        assert_eq!((known(&reading), reading.has_gap("b")), ((false, false), true));
        reading.read("b", "t", &page(1, Some(1), 1));
        assert!(reading.is_read("b", Some("t")) && reading.is_read("b", None));
        // Node b is dead, and the connection is new: once b runs, only what is read now counts.
        reading.opened(|node| node == "b");
        assert!(reading.is_read("b", None));
        reading.read("b", "t", &page(2, Some(1), 1));
        assert!(!reading.is_read("b", None) && !reading.is_read("b", Some("s")));
        reading.forget(|node| node == "b");
        assert_eq!((known(&reading), reading.has_gap("b")), ((false, false), true));
        reading.read("b", "t", &page(1, None, 1));
        assert!(reading.is_read("b", Some("t")) && reading.is_read("b", None));
        reading.opened(|_| false);
        assert_eq!(known(&reading), (false, false));
    }
}
