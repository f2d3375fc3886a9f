//! Commands of the broker: each is remembered before it is given to a link, so that none is executed twice.
//!
//! A command has an id that its sender uses once, and a time: the one in the id, otherwise that of the message, which differs
//! each time that the message is sent. The id is in the store, safely on the disk, before the cell has the command. If the same
//! id arrives again, only its outcome is reported again, even by the next process, and even if the command was refused; a command
//! without an outcome when a process ends is unknown. A command whose time is further from now than
//! [`max_age`](super::site::Commands::max_age), an hour at the most, is refused, and so is one that is not later than every one
//! that was forgotten. docs/bridge.md has the clauses.

use std::collections::HashMap;
use std::ops::RangeInclusive;
use std::time::Duration;

use anyhow::Result;
use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::bucket::{Bucket, Rate};
use super::history::{self, CommandHistory, Entry, Names, time_of};
use super::ledger::Ledger;
use super::metric::{COMMAND, DETAIL, NamedValue, OUTCOME, REQUEST, text};
use super::payload::{Payload, Value};
use super::report::{Command, Order, Outcome};
use crate::store::Batch;

/// The longest id, in bytes.
const MAX_ID_LEN: usize = 64;

/// The known commands of each cell.
#[derive(Debug)]
pub struct Commands {
    /// The maximum age of a command in milliseconds.
    max_age: u64,
    rate: Rate,
    /// The time of the latest command that was not refused.
    latest: u64,
    known: HashMap<String, CommandHistory>,
    ledger: Ledger,
    buckets: HashMap<String, Bucket>,
}

/// A command and its outcome, as bridges report it to one another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CommandReport {
    /// The name of the cell.
    pub cell: String,
    /// The id of the command.
    pub id: String,
    /// The outcome, and the bridge that has accepted the command.
    pub entry: Entry,
}

/// A command that had no outcome when the bridge ended.
#[derive(Debug, PartialEq)]
pub struct InterruptedCommand {
    /// The name of the cell.
    pub cell: String,
    /// The metrics that report the command's outcome.
    pub report: Vec<NamedValue>,
}

/// A message that writes metrics of a cell.
#[derive(Debug, Clone, Copy)]
pub struct Write<'a> {
    /// The name of the cell.
    pub cell: &'a str,
    /// Whether the site file allows commands to the cell.
    pub is_allowed: bool,
    /// The metrics to write, as the message has them.
    pub payload: &'a Payload,
    /// The reason to refuse the command; `None` if there is no such reason.
    pub unfit: Option<&'a str>,
    /// Whether several bridges share the cell.
    pub is_shared: bool,
    /// The reason to refuse every id without a time, because the ids that another bridge has executed are not all known; `None`
    /// if they are known.
    pub unread: Option<&'a str>,
}

/// The decision about a message that writes metrics of a cell.
#[derive(Debug, PartialEq)]
pub enum Decision {
    /// The command is in the batch: once that is written, give it to the cell, and report this.
    Give(Command, Vec<NamedValue>),
    /// The id of the command is known: report its outcome.
    Report(Vec<NamedValue>),
    /// The command is refused, for a reason that has this name in the metrics: report this.
    Refuse(&'static str, Vec<NamedValue>),
    /// The message is not a command that could be reported by an id; the reason.
    Malformed(String),
}

impl Commands {
    /// Reads what the store remembers, given the names that begin with a prefix. A command without an outcome is unknown
    /// from now on.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub fn open(
        names: impl Fn(&str) -> Result<Names>,
        max_age: Duration,
        rate: Rate,
        batch: &mut Batch,
    ) -> Result<(Self, Vec<InterruptedCommand>)> {
        let (mut known, mut unknown) = (CommandHistory::open(names)?, Vec::new());
        for (cell, remembered) in &mut known {
            for (id, entry) in remembered.unfinished(true) {
                entry.outcome = Outcome::Unknown;
                entry.detail = "the bridge ended before the outcome".into();
                history::put(batch, cell, id, Some(entry));
                unknown.push(InterruptedCommand { cell: cell.clone(), report: entry.named(id) });
            }
        }
        let max_age = u64::try_from(max_age.as_millis()).unwrap_or(u64::MAX);
        let latest = known.values().map(CommandHistory::latest).max().unwrap_or_default();
        let mut ledger = Ledger::default();
        for (cell, remembered) in &known {
            let own = remembered.iter().filter(|(_, entry)| entry.is_in_ledger());
            own.for_each(|(id, entry)| ledger.insert(entry.number, cell, id));
        }
        Ok((Self { max_age, rate, latest, known, ledger, buckets: HashMap::new() }, unknown))
    }

    /// Decides about a message for a cell.
    pub fn decide(&mut self, write: Write<'_>, now: u64, batch: &mut Batch) -> Decision {
        let (cell, max_age) = (write.cell, self.max_age);
        let (mut command, at) = match (read(write.payload), write.unfit) {
            (Ok(read), _) => read,
            (Err(_), Some(why)) => return Decision::Malformed(why.into()),
            (Err(why), None) => return Decision::Malformed(why),
        };
        if let Some(entry) = self.known.get(cell).and_then(|known| known.get(&command.id)) {
            return Decision::Report(entry.named(&command.id));
        }
        let of_id = time_of(&command.id);
        let at = of_id.or(at);
        let acceptable = self.acceptable(write, at, of_id.is_some(), now, batch);
        let sent = at.unwrap_or(now);
        let (outcome, detail) = match &acceptable {
            Ok(()) => (Outcome::Accepted, String::new()),
            Err((_, why)) => (Outcome::Refused, why.clone()),
        };
        let is_in_ledger = acceptable.is_ok() && write.is_shared;
        let number = if is_in_ledger { self.ledger.append(cell, &command.id) } else { 0 };
        let entry = Entry { at: now, sent, outcome, detail, by: String::new(), number };
        let report = entry.named(&command.id);
        let known = self.known.entry(cell.to_owned()).or_default();
        known.keep(cell, &command.id, entry, now, max_age, batch);
        command.until = sent.saturating_add(max_age);
        match acceptable {
            Ok(()) => {
                self.latest = self.latest.max(sent);
                Decision::Give(command, report)
            }
            Err((reason, _)) => Decision::Refuse(reason, report),
        }
    }

    /// Decides whether a command is to be given; the error is the reason against it, as it is in the metrics and in words.
    fn acceptable(
        &mut self,
        write: Write<'_>,
        at: Option<u64>,
        has_time: bool,
        now: u64,
        batch: &mut Batch,
    ) -> Result<(), (&'static str, String)> {
        if let Some(why) = write.unfit {
            return Err(("unfit", why.into()));
        }
        if !write.is_allowed {
            return Err(("not_allowed", "the site file does not allow commands to this cell".into()));
        }
        let at = at.ok_or_else(|| ("no_time", "the command has no timestamp".into()))?;
        let age = self.max_age / 1000;
        if at > now.saturating_add(self.max_age) {
            return Err((
                "early",
                format!(
                    "timestamp {at} is more than {age} s ahead of {now}: too early, or a clock is wrong; send it again with another id"
                ),
            ));
        }
        if at < now.saturating_sub(self.max_age) {
            return Err((
                "late",
                format!("timestamp {at} is more than {age} s before {now}: too late, or a clock is wrong"),
            ));
        }
        if let Some(why) = self.known.get(write.cell).and_then(|known| known.bars(at)) {
            return Err(("forgotten", why));
        }
        if let Some(why) = write.unread.filter(|_| !has_time) {
            return Err(("unread", why.into()));
        }
        let rate = self.rate;
        let bucket = self.buckets.entry(write.cell.to_owned()).or_insert_with(|| Bucket::full(rate, now));
        if !bucket.take(rate, now) {
            let Rate { per_second, burst } = rate;
            return Err((
                "rate",
                format!(
                    "this cell accepts {per_second} commands per second, {burst} at once: see commands.rate"
                ),
            ));
        }
        let known = self.known.entry(write.cell.to_owned()).or_default();
        if !has_time && known.is_full(write.cell, now, batch) {
            let most = history::MAX_EXECUTED;
            return Err((
                "full",
                format!("this cell has executed {most} commands within a day: use UUIDs of version 7 as ids"),
            ));
        }
        Ok(())
    }

    /// Returns the number of commands that a cell takes now.
    pub fn left(&self, cell: &str, now: u64) -> f64 {
        self.buckets.get(cell).map_or(self.rate.burst.into(), |bucket| bucket.left(self.rate, now))
    }

    /// Records the outcome of a command that was given to a cell; returns the report.
    pub fn finish(
        &mut self,
        cell: &str,
        id: &str,
        outcome: Outcome,
        detail: String,
        batch: &mut Batch,
    ) -> Vec<NamedValue> {
        let known = self.known.entry(cell.to_owned()).or_default();
        let (at, sent, number) =
            known.get(id).map_or((0, 0, 0), |entry| (entry.at, entry.sent, entry.number));
        let entry = Entry { at, sent, outcome, detail, by: String::new(), number };
        let report = entry.named(id);
        known.keep(cell, id, entry, at, self.max_age, batch);
        report
    }

    /// Ends the commands of a cell whose thread has ended: those without an outcome are unknown from now on. Returns the report
    /// of each.
    pub fn interrupt(&mut self, cell: &str, why: &str, batch: &mut Batch) -> Vec<Vec<NamedValue>> {
        let unfinished = self.known.get_mut(cell).into_iter().flat_map(|known| known.unfinished(true));
        let over = |(id, entry): (&String, &mut Entry)| {
            (entry.outcome, entry.detail) = (Outcome::Unknown, why.into());
            history::put(batch, cell, id, Some(entry));
            entry.named(id)
        };
        unfinished.map(over).collect()
    }

    /// Returns the command of this id, with its outcome.
    pub fn entry(&self, cell: &str, id: &str) -> Option<&Entry> {
        self.known.get(cell)?.get(id)
    }

    /// Returns the pages of the ledger.
    pub fn pages(&self) -> RangeInclusive<u64> {
        self.ledger.pages()
    }

    /// Returns the commands on a page of the ledger that are remembered.
    pub fn page(&self, page: u64) -> Vec<CommandReport> {
        let told = |(cell, id): &(String, String)| {
            let entry = self.entry(cell, id).filter(|entry| entry.is_in_ledger())?.clone();
            Some(CommandReport { cell: cell.clone(), id: id.clone(), entry })
        };
        self.ledger.page(page).filter_map(told).collect()
    }

    /// Returns the time of the latest command that was given, here or by another bridge, as far as is known.
    pub fn latest(&self) -> u64 {
        self.latest
    }

    /// Records another bridge's report of a command. If this bridge has given the command to its cell, its own outcome stands; a
    /// refusal is replaced by any other outcome, since only one bridge gives a command to the cell.
    pub fn merge_report(&mut self, cell: &str, id: &str, entry: Entry, now: u64, batch: &mut Batch) {
        let known = self.known.entry(cell.to_owned()).or_default();
        let is_news = known.get(id).is_none_or(|before| match (before.outcome, entry.outcome) {
            (Outcome::Refused, outcome) => outcome != Outcome::Refused,
            _ if before.by.is_empty() => false,
            (Outcome::Accepted, _) => true,
            (Outcome::Unknown, outcome) => !matches!(outcome, Outcome::Accepted | Outcome::Unknown),
            (Outcome::Done | Outcome::Partial, _) => false,
        });
        if is_news {
            if entry.outcome != Outcome::Refused {
                self.latest = self.latest.max(entry.sent);
            }
            known.keep(cell, id, entry, now, self.max_age, batch);
        }
    }

    /// Takes over a cell. Commands that others were given for it until this time may be unknown here. Returns the report of each
    /// of their commands that have no outcome.
    pub fn take(&mut self, cell: &str, until: u64, batch: &mut Batch) -> Vec<Vec<NamedValue>> {
        let known = self.known.entry(cell.to_owned()).or_default();
        known.bar(cell, until, batch);
        let over = |(id, entry): (&String, &mut Entry)| {
            let by = &entry.by;
            (entry.outcome, entry.detail) =
                (Outcome::Unknown, format!("{by} lost the cell before the outcome"));
            history::put(batch, cell, id, Some(entry));
            entry.named(id)
        };
        known.unfinished(false).map(over).collect()
    }

    /// Forgets commands that are older than a day.
    pub fn forget(&mut self, now: u64, batch: &mut Batch) {
        for (cell, known) in &mut self.known {
            known.forget(cell, now, self.max_age, batch);
        }
        let known = &self.known;
        self.ledger.retain(|cell, id| {
            known.get(cell).and_then(|known| known.get(id)).is_some_and(Entry::is_in_ledger)
        });
    }
}

impl Entry {
    /// Returns whether this bridge has accepted the command, and shares its cell.
    pub fn is_in_ledger(&self) -> bool {
        self.number > 0 && self.by.is_empty()
    }

    fn named(&self, id: &str) -> Vec<NamedValue> {
        let detail = text(self.detail.as_str());
        vec![(COMMAND, text(id)), (OUTCOME, text(self.outcome.name())), (DETAIL, detail)]
    }
}

/// Returns the command of a message, and its time.
fn read(payload: &Payload) -> Result<(Command, Option<u64>), String> {
    let [metric] = payload.metrics.as_slice() else {
        return Err(format!("write only the metric {REQUEST}"));
    };
    if metric.name.as_deref() != Some(REQUEST) {
        let name = metric.name.as_deref().unwrap_or("without a name");
        return Err(format!("the metric {name} cannot be written: write {REQUEST}"));
    }
    let Some(Value::String(text)) = &metric.value else { return Err(format!("{REQUEST} must be a string")) };
    let Order(mut order) =
        serde_json::from_str(text).map_err(|error| format!("{REQUEST} is not a JSON object: {error}"))?;
    let id = match order.remove("id") {
        Some(Json::String(id)) if (1..=MAX_ID_LEN).contains(&id.len()) && !id.contains(char::is_control) => {
            id
        }
        _ => {
            return Err(format!("{REQUEST} has no \"id\": give a unique string of 1 to {MAX_ID_LEN} bytes"));
        }
    };
    Ok((Command { id, order, until: 0 }, metric.timestamp.or(payload.timestamp)))
}

#[cfg(test)]
mod tests;
