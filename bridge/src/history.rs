//! The commands of one cell that are remembered, so that none is executed twice and none that was refused is executed later.
//!
//! An id that is a UUID of version 7 has a time in it, which is the same however the command is sent again. So such commands, and
//! refused ones, are forgotten to make space for others, and leave a mark: a command that is not later is refused. Every other id
//! of an executed command is remembered for a day at least.

use std::collections::HashMap;
use std::time::Duration;

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};

use super::report::Outcome;
use crate::store::Batch;

/// Names of the store and their values.
pub type Names = Vec<(String, String)>;

/// The prefix of a name in the store, before CELL/ID.
const PREFIX: &str = "command/";
/// The prefix of a name in the store, before the cell: a summary of its forgotten commands.
const FORGOTTEN: &str = "forgotten/";
/// The time for which an outcome can be requested.
const RETENTION: Duration = Duration::from_secs(24 * 3600);
/// The number that is remembered: of those that make room for others, and of the others that are older than a day.
pub const MAX_ENTRIES: usize = 20_000;
/// The maximum number of executed commands of a day whose ids have no time.
pub const MAX_EXECUTED: usize = 100_000;

/// The commands of a cell.
#[derive(Debug, Default)]
pub struct CommandHistory {
    /// Refused commands, and those whose ids have a time.
    entries: HashMap<String, Entry>,
    /// Executed commands whose ids have no time.
    executed: HashMap<String, Entry>,
    forgotten: Forgotten,
}

/// A command, as it is remembered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// The time at which the command was received.
    pub at: u64,
    /// The time in the command's id, or that of the message.
    #[serde(default)]
    pub sent: u64,
    /// The outcome of the command.
    pub outcome: Outcome,
    /// The reason for the outcome.
    pub detail: String,
    /// The bridge that the command was given to, if that is another one.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub by: String,
    /// The number in the ledger of the bridge that has accepted the command; 0 for a command that is in no ledger.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub number: u64,
}

fn is_zero(number: &u64) -> bool {
    *number == 0
}

/// Returns the time in an id, in milliseconds since 1970 UTC, if the id is a UUID of version 7 (RFC 9562, section 5.7).
pub fn time_of(id: &str) -> Option<u64> {
    let is_uuid = id.len() == 36
        && id.bytes().enumerate().all(|(at, byte)| match at {
            8 | 13 | 18 | 23 => byte == b'-',
            14 => byte == b'7',
            19 => matches!(byte, b'8' | b'9' | b'a' | b'b' | b'A' | b'B'),
            _ => byte.is_ascii_hexdigit(),
        });
    let digits = is_uuid.then(|| Some(format!("{}{}", id.get(..8)?, id.get(9..13)?)))??;
    u64::from_str_radix(&digits, 16).ok()
}

/// A summary of commands that are not remembered one by one.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
struct Forgotten {
    /// The latest time of a command that was forgotten.
    until: u64,
    /// The times, from and to, of commands that were refused as too early.
    early: Option<(u64, u64)>,
}

impl CommandHistory {
    /// Reads the commands of every cell from the store.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub fn open(names: impl Fn(&str) -> Result<Names>) -> Result<HashMap<String, Self>> {
        let mut cells: HashMap<String, Self> = HashMap::new();
        for (name, value) in names(PREFIX)? {
            let entry = serde_json::from_str(&value).with_context(|| format!("{name} in the store"))?;
            if let Some((cell, id)) = name.strip_prefix(PREFIX).and_then(|key| key.split_once('/')) {
                cells.entry(cell.to_owned()).or_default().of(id, &entry).0.insert(id.to_owned(), entry);
            }
        }
        for (name, value) in names(FORGOTTEN)? {
            let cell = name.strip_prefix(FORGOTTEN).unwrap_or_default().to_owned();
            cells.entry(cell).or_default().forgotten =
                serde_json::from_str(&value).with_context(|| format!("{name} in the store"))?;
        }
        Ok(cells)
    }

    /// Returns the command of an id.
    pub fn get(&self, id: &str) -> Option<&Entry> {
        self.executed.get(id).or_else(|| self.entries.get(id))
    }

    /// Returns every command.
    pub fn iter(&self) -> impl Iterator<Item = (&String, &Entry)> {
        self.entries.iter().chain(&self.executed)
    }

    /// Returns the map of an entry, and the other one.
    fn of(&mut self, id: &str, entry: &Entry) -> (&mut HashMap<String, Entry>, &mut HashMap<String, Entry>) {
        match entry.outcome != Outcome::Refused && time_of(id).is_none() {
            true => (&mut self.executed, &mut self.entries),
            false => (&mut self.entries, &mut self.executed),
        }
    }

    /// Returns the commands that have no outcome: this bridge's, or those of others.
    pub fn unfinished(&mut self, is_own: bool) -> impl Iterator<Item = (&String, &mut Entry)> {
        let is_wanted =
            move |entry: &Entry| entry.outcome == Outcome::Accepted && entry.by.is_empty() == is_own;
        self.entries.iter_mut().chain(&mut self.executed).filter(move |(_, entry)| is_wanted(entry))
    }

    /// Returns the time of the latest command that was not refused, or was forgotten.
    pub fn latest(&self) -> u64 {
        let given = self.iter().filter(|(_, entry)| entry.outcome != Outcome::Refused);
        given.map(|(_, entry)| entry.sent).chain([self.forgotten.until]).max().unwrap_or_default()
    }

    /// Refuses unknown commands up to this time: they may have been given without being known here.
    pub fn bar(&mut self, cell: &str, until: u64, batch: &mut Batch) {
        if until > self.forgotten.until {
            self.forgotten.until = until;
            self.mark(cell, batch);
        }
    }

    /// Returns the reason why a command of this time is refused because of others that were forgotten, if there is one.
    pub fn bars(&self, sent: u64) -> Option<String> {
        let Forgotten { until, early } = self.forgotten;
        match early {
            _ if sent <= until => Some(format!(
                "its timestamp {sent} is not after {until}, up to which commands are forgotten: a flood, a wrong clock, or another bridge had the cell"
            )),
            Some((from, to)) if (from..=to).contains(&sent) => Some(format!(
                "too many commands dated {from} to {to} were refused as too early; its timestamp is {sent}"
            )),
            _ => None,
        }
    }

    /// Remembers a command, or its outcome.
    pub fn keep(&mut self, cell: &str, id: &str, entry: Entry, now: u64, max_age: u64, batch: &mut Batch) {
        put(batch, cell, id, Some(&entry));
        let (entries, others) = self.of(id, &entry);
        others.remove(id);
        entries.insert(id.to_owned(), entry);
        if self.entries.len() > MAX_ENTRIES {
            self.make_room(cell, now.saturating_add(max_age), batch);
        }
    }

    /// Returns whether a further command whose id has no time would be forgotten within a day.
    pub fn is_full(&mut self, cell: &str, now: u64, batch: &mut Batch) -> bool {
        self.executed.len() >= MAX_EXECUTED && {
            self.forget_executed(cell, now, batch);
            self.executed.len() >= MAX_EXECUTED
        }
    }

    /// Forgets the oldest commands, or those that were refused as later than `latest`, if these are the most numerous.
    fn make_room(&mut self, cell: &str, latest: u64, batch: &mut Batch) {
        let over = self.entries.iter().filter(|(_, entry)| entry.outcome != Outcome::Accepted);
        let (mut early, mut due): (Vec<_>, Vec<_>) =
            over.map(|(id, entry)| (entry.sent, id.clone())).partition(|(sent, _)| *sent > latest);
        let gone = if early.len() > MAX_ENTRIES / 2 {
            early.sort_unstable();
            let (first, last) = (early.first().map_or(0, |it| it.0), early.last().map_or(0, |it| it.0));
            let (from, to) = self.forgotten.early.unwrap_or((first, last));
            self.forgotten.early = Some((from.min(first), to.max(last)));
            early
        } else {
            due.sort_unstable();
            due.truncate(MAX_ENTRIES / 8);
            self.forgotten.until = self.forgotten.until.max(due.last().map_or(0, |it| it.0));
            due
        };
        for (_, id) in gone {
            put(batch, cell, &id, None);
            self.entries.remove(&id);
        }
        self.mark(cell, batch);
    }

    /// Forgets commands that are older than a day and cannot be accepted any more.
    pub fn forget(&mut self, cell: &str, now: u64, max_age: u64, batch: &mut Batch) {
        let (before, kept) = (self.forgotten, u64::try_from(RETENTION.as_millis()).unwrap_or(u64::MAX));
        let forgotten = &mut self.forgotten;
        self.entries.retain(|id, entry| {
            let until = entry.at.saturating_add(kept).max(entry.sent.saturating_add(max_age));
            let is_over = now > until && entry.outcome != Outcome::Accepted;
            if is_over {
                put(batch, cell, id, None);
                forgotten.until = forgotten.until.max(entry.sent);
            }
            !is_over
        });
        forgotten.early.take_if(|(_, to)| now > to.saturating_add(max_age));
        if *forgotten != before {
            self.mark(cell, batch);
        }
        self.forget_executed(cell, now, batch);
    }

    /// Forgets executed commands that are older than a day, the oldest first, until [`MAX_ENTRIES`] are left.
    fn forget_executed(&mut self, cell: &str, now: u64, batch: &mut Batch) {
        let kept = u64::try_from(RETENTION.as_millis()).unwrap_or(u64::MAX);
        let is_over =
            |entry: &Entry| now > entry.at.saturating_add(kept) && entry.outcome != Outcome::Accepted;
        let old = self.executed.iter().filter(|(_, entry)| is_over(entry));
        let mut old: Vec<_> = old.map(|(id, entry)| (entry.at, id.clone())).collect();
        old.sort_unstable();
        old.truncate(self.executed.len().saturating_sub(MAX_ENTRIES));
        for (_, id) in old {
            put(batch, cell, &id, None);
            self.executed.remove(&id);
        }
    }

    fn mark(&self, cell: &str, batch: &mut Batch) {
        let value = serde_json::to_string(&self.forgotten).unwrap_or_default();
        batch.names.push((format!("{FORGOTTEN}{cell}"), Some(value)));
    }
}

/// Writes a command, or removes it.
pub fn put(batch: &mut Batch, cell: &str, id: &str, entry: Option<&Entry>) {
    let value = entry.map(|entry| serde_json::to_string(entry).unwrap_or_default());
    batch.names.push((format!("{PREFIX}{cell}/{id}"), value));
}

#[cfg(test)]
mod tests {
    use super::*;

    const AGE: u64 = 30_000;

    fn refused(sent: u64) -> Entry {
        Entry {
            at: 1_000_000,
            sent,
            outcome: Outcome::Refused,
            detail: String::new(),
            by: String::new(),
            number: 0,
        }
    }

    #[test]
    fn a_flood_forgets_the_oldest_and_what_is_not_later_is_barred() {
        let (mut cell, mut batch) = (CommandHistory::default(), Batch::default());
        let begun = Entry { outcome: Outcome::Accepted, ..refused(1) };
        cell.keep("c", "begun", begun.clone(), 1_000_000, AGE, &mut batch);
        for number in 0..=u64::try_from(MAX_ENTRIES).unwrap() {
            cell.keep("c", &number.to_string(), refused(1_000_000 + number), 1_000_000, AGE, &mut batch);
        }
        assert!(cell.entries.len() <= MAX_ENTRIES);
        assert_eq!(cell.get("begun"), Some(&begun));
        assert_eq!((cell.get("2499"), cell.get("2500")), (None, Some(&refused(1_002_500))));
        let why = "its timestamp 1002499 is not after 1002499, up to which commands are forgotten: a flood, a wrong clock, or another bridge had the cell";
        assert_eq!((cell.bars(1_002_499), cell.bars(1_002_500)), (Some(why.into()), None));
        assert!(
            batch.names.contains(&("forgotten/c".into(), Some(r#"{"until":1002499,"early":null}"#.into())))
        );
    }

    #[test]
    fn a_flood_from_the_future_bars_its_own_times_and_no_others() {
        let (mut cell, mut batch, future) = (CommandHistory::default(), Batch::default(), 9_000_000);
        cell.keep("c", "now", refused(1_000_000), 1_000_000, AGE, &mut batch);
        for number in 0..u64::try_from(MAX_ENTRIES).unwrap() {
            cell.keep("c", &number.to_string(), refused(future + number), 1_000_000, AGE, &mut batch);
        }
        assert!(cell.get("now").is_some() && cell.get("0").is_none());
        assert_eq!((cell.bars(1_000_001), cell.bars(future - 1)), (None, None));
        let why =
            "too many commands dated 9000000 to 9019999 were refused as too early; its timestamp is 9000007";
        assert_eq!(cell.bars(future + 7), Some(why.into()));
        // They are kept until they cannot be accepted any more.
        cell.forget("c", future + 19_999 + AGE, AGE, &mut batch);
        assert!(cell.bars(future + 7).is_some());
        cell.forget("c", future + 20_000 + AGE, AGE, &mut batch);
        assert!(cell.bars(future + 7).is_none());
    }

    #[test]
    fn what_was_too_early_is_remembered_until_it_is_too_late() {
        let (mut cell, mut batch, day) = (CommandHistory::default(), Batch::default(), 86_400_000);
        cell.keep("c", "early", refused(1_000_000 + 3 * day), 1_000_000, AGE, &mut batch);
        cell.forget("c", 1_000_000 + 3 * day + AGE, AGE, &mut batch);
        assert!(cell.get("early").is_some());
        cell.forget("c", 1_000_001 + 3 * day + AGE, AGE, &mut batch);
        assert!(cell.get("early").is_none() && cell.bars(1_000_000 + 3 * day).is_some());
    }
}
