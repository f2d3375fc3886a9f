//! A cell, as the hub and the connection to the broker know it.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

use tokio::sync::mpsc::UnboundedSender;
use tokio::sync::watch;
use tokio::task::JoinHandle;

use super::bands::Bands;
use super::links::Client;
use super::metric::{COMMON, Definition};
use super::payload::{Metric, Quality, Value};
use super::report::Command;
use super::site;

/// A cell, as the hub knows it.
#[derive(Debug)]
pub struct Cell {
    /// The name of the cell: Sparkplug's device.
    pub name: String,
    /// The link of the cell.
    pub link: String,
    /// Every metric that the cell may report.
    pub definitions: Vec<Definition>,
    /// The values that the cell has reported last, and their times.
    pub values: HashMap<&'static str, (u64, Value)>,
    /// Whether the link is connected.
    pub is_connected: bool,
    /// The time since which `is_connected` has this value, in milliseconds since 1970 UTC.
    pub since: u64,
    /// The reason why the link is not connected.
    pub why: String,
    /// Whether the broker has the cell's birth.
    pub is_born: bool,
    /// The number of the cell's last record.
    pub number: u64,
    /// The number of the cell's last record that was written.
    pub written: u64,
    /// The number of the cell's last record, as it is kept beside the records.
    pub kept: u64,
    /// The time of the cell's last record.
    pub last_at: u64,
    /// The number of failures while the device did not answer.
    pub failures: Arc<AtomicU64>,
    /// Whether the site file allows commands to the cell.
    pub takes_commands: bool,
    /// Whether the cell may be another bridge's.
    pub is_shared: bool,
    /// The changes by which metrics are reported; `None`: the cell does not report by exception.
    pub bands: Option<Bands>,
    /// The sender of commands to the cell's task.
    pub commands: UnboundedSender<Command>,
    /// The sender of true when the cell's task is to end.
    pub stop: watch::Sender<bool>,
    /// The task of the cell; `None` before it begins and after it has ended.
    pub task: Option<JoinHandle<()>>,
    /// The next state, after a change of the site file or of the lease: another cell is begun when the task has ended.
    pub next: CellUpdate,
}

/// The next state of a cell.
#[derive(Debug, Default)]
pub enum CellUpdate {
    /// The cell continues as before.
    #[default]
    Same,
    /// The cell is not in the site file any more.
    Gone,
    /// The cell is not this bridge's now.
    Away,
    /// The cell is replaced by another one.
    Another(Box<(site::Cell, Client)>),
}

/// A report and a command of the same cell may cross, and the later one of their times is that of both then. A greater step
/// back is the clock's.
const CROSSED: u64 = 60_000;

/// Returns the time of a record that was made at `at`, after one that has the time `last`.
pub fn in_order(last: u64, at: u64) -> u64 {
    if last.saturating_sub(at) < CROSSED { at.max(last) } else { at }
}

impl Cell {
    /// Returns whether the cell is not in the site file any more.
    pub fn is_gone(&self) -> bool {
        matches!(self.next, CellUpdate::Gone)
    }

    /// Returns whether the cell is this bridge's, and is to stay so.
    pub fn is_here(&self) -> bool {
        !self.is_shared || matches!(self.next, CellUpdate::Same) && self.task.is_some()
    }

    /// Returns whether the cell's task has ended.
    pub fn has_ended(&self) -> bool {
        self.task.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Returns whether a task that was to end has ended, or whether a slot is free.
    pub fn is_over(&self) -> bool {
        match self.next {
            // Without a lease a task ends on its own.
            CellUpdate::Same => self.is_shared && self.has_ended(),
            CellUpdate::Gone | CellUpdate::Away => self.task.is_some() && self.has_ended(),
            CellUpdate::Another(_) => self.has_ended(),
        }
    }

    /// Returns the alias of a metric, for the cell of this index: no two metrics of a node have the same alias.
    pub fn alias(&self, place: usize, name: &str) -> Option<u64> {
        let metric = self.definitions.iter().position(|definition| definition.name == name)?;
        Some((place as u64 + 1) << 16 | metric as u64)
    }

    /// Returns the metric of an alias.
    pub fn by_alias(&self, place: usize, alias: u64) -> Option<&'static str> {
        self.definitions.iter().map(|it| it.name).find(|name| self.alias(place, name) == Some(alias))
    }

    /// Returns the cell's own metrics as null: the cell has no values from now on.
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
