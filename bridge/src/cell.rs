//! A cell, as the hub and the connection to the broker know it.

use std::collections::HashMap;
use std::sync::mpsc::Sender;

use super::metric::{COMMON, Definition};
use super::payload::{Metric, Quality, Value};
use super::report::Command;

/// A cell, as the hub knows it.
#[derive(Debug)]
pub struct Cell {
    /// Its name: Sparkplug's device.
    pub name: String,
    /// Its link.
    pub link: String,
    /// Every metric that it may report.
    pub definitions: Vec<Definition>,
    /// The values that it has reported last, and when.
    pub values: HashMap<&'static str, (u64, Value)>,
    /// Whether its link is connected.
    pub is_connected: bool,
    /// Since when that is so, in milliseconds since 1970 UTC.
    pub since: u64,
    /// Why its link is not connected.
    pub why: String,
    /// Whether the broker has its birth.
    pub is_born: bool,
    /// The number of its last record.
    pub number: u64,
    /// The number of its last record that was written.
    pub written: u64,
    /// The number that is kept beside the records.
    pub kept: u64,
    /// The time of its last record.
    pub last_at: u64,
    /// Whether the hall's file allows commands to it.
    pub takes_commands: bool,
    /// Where its thread takes them.
    pub commands: Sender<Command>,
}

/// A report and a command of the same cell may cross, and the later one of their times is that of both then. A greater step back is the
/// clock's.
const CROSSED: u64 = 60_000;

/// The time of a record that was made at `at`, after one that has the time `last`.
pub fn in_order(last: u64, at: u64) -> u64 {
    if last.saturating_sub(at) < CROSSED { at.max(last) } else { at }
}

impl Cell {
    /// The metrics of its own, as null: it has no values from now on.
    pub fn nulls(&mut self, at: u64, quality: Quality) -> Vec<Metric> {
        let own = self.definitions.iter().filter(|definition| !COMMON.contains(definition));
        let null = |Definition { name, kind }: &Definition| {
            self.values.remove(name);
            Metric::null(name, *kind, at, quality)
        };
        own.map(null).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_go_on_unless_the_clock_is_set_back() {
        assert_eq!((in_order(1_000_000, 1_000_001), in_order(1_000_000, 999_998)), (1_000_001, 1_000_000));
        assert_eq!((in_order(1_000_000, 940_001), in_order(1_000_000, 940_000)), (1_000_000, 940_000));
    }
}
