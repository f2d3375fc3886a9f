//! The ledger of a bridge: the numbers of the commands of shared cells that it has accepted, in pages. The broker stores the
//! pages, so that another bridge can read them when this one does not run.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// The number of commands on a page.
const PAGE: u64 = 64;

/// Commands by their numbers, which begin at 1.
#[derive(Debug, Default)]
pub struct Ledger {
    /// The cell and the id of each command.
    commands: BTreeMap<u64, (String, String)>,
    last: u64,
}

impl Ledger {
    /// Adds a command that has its number, as the store has it.
    pub fn insert(&mut self, number: u64, cell: &str, id: &str) {
        self.last = self.last.max(number);
        self.commands.insert(number, (cell.to_owned(), id.to_owned()));
    }

    /// Adds a command. Returns its number.
    pub fn append(&mut self, cell: &str, id: &str) -> u64 {
        self.insert(self.last + 1, cell, id);
        self.last
    }

    /// Removes the commands that are no longer remembered.
    pub fn retain(&mut self, is_remembered: impl Fn(&str, &str) -> bool) {
        self.commands.retain(|_, (cell, id)| is_remembered(cell, id));
    }

    /// Returns the pages, of which the last one has free space for the next command.
    pub fn pages(&self) -> RangeInclusive<u64> {
        let open = page_of(self.last + 1);
        self.commands.first_key_value().map_or(open, |(first, _)| page_of(*first))..=open
    }

    /// Returns the cell and the id of each command on a page.
    pub fn page(&self, page: u64) -> impl Iterator<Item = &(String, String)> {
        let first = page.saturating_mul(PAGE);
        self.commands.range(first..first.saturating_add(PAGE)).map(|(_, command)| command)
    }
}

/// Returns the page of a number.
pub fn page_of(number: u64) -> u64 {
    number / PAGE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_has_64_numbers_and_the_last_has_room_for_another() {
        let mut ledger = Ledger::default();
        assert_eq!((ledger.pages(), ledger.page(0).count()), (0..=0, 0));
        for number in 1..=62 {
            assert_eq!(ledger.append("c", &number.to_string()), number);
        }
        assert_eq!((ledger.pages(), ledger.append("c", "63"), ledger.pages()), (0..=0, 63, 0..=1));
        assert_eq!((ledger.page(0).count(), ledger.page(1).count(), ledger.append("d", "64")), (63, 0, 64));
        assert_eq!(ledger.page(1).collect::<Vec<_>>(), [&("d".to_owned(), "64".to_owned())]);
        ledger.retain(|cell, _| cell == "d");
        assert_eq!((ledger.pages(), ledger.page(0).count()), (1..=1, 0));
        ledger.retain(|_, _| false);
        assert_eq!((ledger.pages(), ledger.append("c", "65")), (1..=1, 65));
    }
}
