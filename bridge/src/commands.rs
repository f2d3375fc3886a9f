//! Commands of the broker: each is remembered before it is given to a link, so that none is executed twice.
//!
//! A command has an id that its sender uses once, and a time. The id is in the store, safely on the disk, before the cell has the
//! command. The same id again only has its outcome reported again, also by the next process; what had no outcome when a process
//! ended is unknown. Ids are remembered for a day, and a command whose time is further from now than
//! [`max_age`](super::hall::Commands::max_age), an hour at the most, is refused: what is forgotten is too old to be obeyed. Where the
//! clock was wrong for a while it would not be: so a command that is not later than every one that was forgotten is refused too.

use std::collections::HashMap;
use std::time::Duration;

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value as Json};

use super::metric::{COMMAND, DETAIL, Named, OUTCOME, REQUEST, text};
use super::payload::{Payload, Value};
use super::report::{Command, Outcome};
use crate::store::{Batch, Store};

const PREFIX: &str = "command/";
/// The name, in the store, of the latest time of a command that was forgotten.
const FORGOTTEN: &str = "forgotten";
/// So long an id is remembered.
const KEPT: Duration = Duration::from_secs(24 * 3600);
/// So many are.
const MOST: usize = 100_000;
/// The longest id, in bytes.
const LONGEST_ID: usize = 64;

/// What is known of the commands of a day.
#[derive(Debug)]
pub struct Commands {
    max_age: Duration,
    known: HashMap<String, Entry>,
    /// The latest time of a command that was forgotten.
    forgotten: u64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Entry {
    /// When it was received.
    at: u64,
    /// Its own time.
    #[serde(default)]
    sent: u64,
    outcome: Outcome,
    detail: String,
}

/// A command that had no outcome when the bridge ended.
#[derive(Debug, PartialEq)]
pub struct Interrupted {
    /// The cell.
    pub cell: String,
    /// What is to be reported.
    pub report: Vec<Named>,
}

/// What is to be done about a message that writes metrics of a cell.
#[derive(Debug, PartialEq)]
pub enum Decision {
    /// The command is in the batch: once that is written, give it to the cell, and report this.
    Give(Command, Vec<Named>),
    /// Report this.
    Report(Vec<Named>),
    /// It is no command that could be reported by an id, and why.
    Strange(String),
}

impl Commands {
    /// What the store remembers. What had no outcome is unknown from now on.
    ///
    /// # Errors
    /// When the store cannot be read.
    pub fn open(store: &Store, max_age: Duration, batch: &mut Batch) -> Result<(Self, Vec<Interrupted>)> {
        let (mut known, mut unknown) = (HashMap::new(), Vec::new());
        for (name, value) in store.names(PREFIX)? {
            let mut entry: Entry =
                serde_json::from_str(&value).with_context(|| format!("{name} in the store"))?;
            let key = name.strip_prefix(PREFIX).unwrap_or_default().to_owned();
            if entry.outcome == Outcome::Accepted {
                entry.outcome = Outcome::Unknown;
                entry.detail = "the bridge has ended before the outcome".into();
                if let Some((cell, id)) = key.split_once('/') {
                    unknown.push(Interrupted { cell: cell.to_owned(), report: entry.named(id) });
                }
                put(batch, &key, Some(&entry));
            }
            known.insert(key, entry);
        }
        let forgotten = store.get(FORGOTTEN)?.and_then(|text| text.parse().ok()).unwrap_or_default();
        Ok((Self { max_age, known, forgotten }, unknown))
    }

    /// Decides about a message for a cell; `allowed` is whether the cell takes commands.
    pub fn decide(
        &mut self,
        cell: &str,
        allowed: bool,
        payload: &Payload,
        now: u64,
        batch: &mut Batch,
    ) -> Decision {
        let (mut command, at) = match read(payload) {
            Ok(read) => read,
            Err(why) => return Decision::Strange(why),
        };
        let key = key(cell, &command.id);
        if let Some(entry) = self.known.get(&key) {
            return Decision::Report(entry.named(&command.id));
        }
        let mut entry = Entry { at: now, sent: 0, outcome: Outcome::Refused, detail: String::new() };
        match self.acceptable(allowed, at, now) {
            Ok(sent) => {
                (entry.sent, entry.outcome) = (sent, Outcome::Accepted);
                let age = u64::try_from(self.max_age.as_millis()).unwrap_or(u64::MAX);
                command.until = sent.saturating_add(age);
                put(batch, &key, Some(&entry));
                let report = entry.named(&command.id);
                self.known.insert(key, entry);
                Decision::Give(command, report)
            }
            // It is not remembered: nothing was done, and nothing will be.
            Err(why) => {
                entry.detail = why;
                Decision::Report(entry.named(&command.id))
            }
        }
    }

    /// The time of a command that is to be given, or why it is not.
    fn acceptable(&self, allowed: bool, at: Option<u64>, now: u64) -> Result<u64, String> {
        if !allowed {
            return Err("the hall's file does not allow commands to this cell".into());
        }
        let at = at.ok_or("it has no time")?;
        if u128::from(at.abs_diff(now)) > self.max_age.as_millis() {
            let age = self.max_age.as_secs();
            return Err(format!(
                "its time {at} is more than {age} s from now, {now}: too late, or a clock is wrong"
            ));
        }
        if at <= self.forgotten {
            let last = self.forgotten;
            return Err(format!("commands up to {last} are forgotten, its time is {at}: a clock was wrong"));
        }
        if self.known.len() >= MOST {
            return Err(format!("more than {MOST} commands in a day"));
        }
        Ok(at)
    }

    /// The outcome of a command that was given to a cell: what is to be reported.
    pub fn finish(
        &mut self,
        cell: &str,
        id: &str,
        outcome: Outcome,
        detail: String,
        batch: &mut Batch,
    ) -> Vec<Named> {
        let key = key(cell, id);
        let (at, sent) = self.known.get(&key).map_or((0, 0), |entry| (entry.at, entry.sent));
        let entry = Entry { at, sent, outcome, detail };
        put(batch, &key, Some(&entry));
        let report = entry.named(id);
        self.known.insert(key, entry);
        report
    }

    /// Forgets what is older than a day.
    pub fn forget(&mut self, now: u64, batch: &mut Batch) {
        let before = self.forgotten;
        self.known.retain(|key, entry| {
            let is_old = u128::from(now.saturating_sub(entry.at)) > KEPT.as_millis();
            let is_over = is_old && entry.outcome != Outcome::Accepted;
            if is_over {
                put(batch, key, None);
                self.forgotten = self.forgotten.max(entry.sent);
            }
            !is_over
        });
        if self.forgotten > before {
            batch.names.push((FORGOTTEN.into(), Some(self.forgotten.to_string())));
        }
    }
}

impl Entry {
    fn named(&self, id: &str) -> Vec<Named> {
        let detail = text(self.detail.as_str());
        vec![(COMMAND, text(id)), (OUTCOME, text(self.outcome.name())), (DETAIL, detail)]
    }
}

fn key(cell: &str, id: &str) -> String {
    format!("{cell}/{id}")
}

fn put(batch: &mut Batch, key: &str, entry: Option<&Entry>) {
    let value = entry.map(|entry| serde_json::to_string(entry).unwrap_or_default());
    batch.names.push((format!("{PREFIX}{key}"), value));
}

/// The command of a message, and its time.
fn read(payload: &Payload) -> Result<(Command, Option<u64>), String> {
    let [metric] = payload.metrics.as_slice() else {
        return Err(format!("write the metric {REQUEST}, and no other"));
    };
    if metric.name.as_deref() != Some(REQUEST) {
        let name = metric.name.as_deref().unwrap_or("without a name");
        return Err(format!("the metric {name} cannot be written: write {REQUEST}"));
    }
    let Some(Value::String(text)) = &metric.value else { return Err(format!("{REQUEST} is a text")) };
    let mut order: Map<String, Json> =
        serde_json::from_str(text).map_err(|error| format!("{REQUEST} is no object of JSON: {error}"))?;
    let id = match order.remove("id") {
        Some(Json::String(id)) if (1..=LONGEST_ID).contains(&id.len()) && !id.contains(char::is_control) => {
            id
        }
        _ => {
            return Err(format!(
                "{REQUEST} has no \"id\": give a text of 1 to {LONGEST_ID} bytes, each once"
            ));
        }
    };
    Ok((Command { id, order, until: 0 }, metric.timestamp.or(payload.timestamp)))
}

#[cfg(test)]
mod tests {
    use super::super::payload::{Kind, Metric};
    use super::*;

    fn write(text: &str, at: u64) -> Payload {
        let metric = Metric::new(REQUEST, Kind::String, at, Some(Value::String(text.into())));
        Payload { timestamp: Some(1), metrics: vec![metric], seq: None }
    }

    fn outcome(decision: &Decision) -> (&'static str, String) {
        let (kind, named) = match decision {
            Decision::Give(_, named) => ("give", named),
            Decision::Report(named) => ("report", named),
            Decision::Strange(why) => return ("strange", why.clone()),
        };
        let of = |name| {
            named.iter().find_map(|(found, value)| match value {
                Value::String(text) if *found == name => Some(text.clone()),
                _ => None,
            })
        };
        (kind, format!("{} {}: {}", of(COMMAND).unwrap(), of(OUTCOME).unwrap(), of(DETAIL).unwrap()))
    }

    #[test]
    fn an_id_is_given_to_the_cell_once_also_by_the_next_process() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("store");
        let age = Duration::from_secs(30);
        let (mut store, mut batch) = (Store::open(&path, 9).unwrap(), Batch::default());
        let (mut commands, unknown) = Commands::open(&store, age, &mut batch).unwrap();
        assert!(unknown.is_empty());
        let request = write(r#"{"id":"a","write_register":{"address":1,"value":2}}"#, 1_000_000);
        let decision = commands.decide("cell", true, &request, 1_000_900, &mut batch);
        let Decision::Give(command, _) = &decision else { panic!("{decision:?}") };
        assert_eq!((command.id.as_str(), command.order.len(), command.until), ("a", 1, 1_030_000));
        assert_eq!(outcome(&decision), ("give", "a accepted: ".into()));
        let again = commands.decide("cell", true, &request, 1_000_901, &mut batch);
        assert_eq!(outcome(&again), ("report", "a accepted: ".into()));
        // Another cell's id is another's.
        assert_eq!(outcome(&commands.decide("other", true, &request, 1_000_902, &mut batch)).0, "give");
        commands.finish("other", "a", Outcome::Done, String::new(), &mut batch);
        store.write(&batch).unwrap();
        drop((store, commands));

        // The process was killed: what had no outcome is unknown, and is not given again, however late it is asked for.
        let (mut store, mut batch) = (Store::open(&path, 9).unwrap(), Batch::default());
        let (mut commands, unknown) = Commands::open(&store, age, &mut batch).unwrap();
        let why = "a unknown: the bridge has ended before the outcome";
        let [Interrupted { cell, report }] = &unknown[..] else { panic!("{unknown:?}") };
        assert_eq!((cell.as_str(), outcome(&Decision::Report(report.clone())).1), ("cell", why.into()));
        for (cell, outcome_then) in [("cell", why), ("other", "a done: ")] {
            let decision = commands.decide(cell, true, &request, 9_000_000, &mut batch);
            assert_eq!(outcome(&decision), ("report", outcome_then.into()));
        }
        store.write(&batch).unwrap();
        // A day later it is forgotten, and too old to be obeyed.
        let (later, mut batch) = (1_000_902 + 86_400_001, Batch::default());
        commands.forget(later, &mut batch);
        assert_eq!(batch.names.len(), 3);
        let decision = commands.decide("cell", true, &request, later, &mut batch);
        let (kind, text) = outcome(&decision);
        assert!(
            kind == "report" && text.starts_with("a refused: its time 1000000 is more than 30 s from now"),
            "{text}"
        );
    }

    #[test]
    fn a_clock_that_was_wrong_for_a_while_makes_no_command_new() {
        const DAY: u64 = 86_400_000;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("store");
        let age = Duration::from_secs(30);
        let (mut store, mut batch) = (Store::open(&path, 9).unwrap(), Batch::default());
        let (mut commands, _) = Commands::open(&store, age, &mut batch).unwrap();
        let request = write(r#"{"id":"a"}"#, 1_000_000);
        assert_eq!(outcome(&commands.decide("c", true, &request, 1_000_000, &mut batch)).0, "give");
        commands.finish("c", "a", Outcome::Done, String::new(), &mut batch);
        // Two days too late, and right again.
        commands.forget(1_000_000 + 2 * DAY, &mut batch);
        store.write(&batch).unwrap();
        let why = "a refused: commands up to 1000000 are forgotten, its time is 1000000: a clock was wrong";
        let again = commands.decide("c", true, &request, 1_000_500, &mut batch);
        assert_eq!(outcome(&again), ("report", why.into()));
        drop(commands);
        let (mut commands, _) = Commands::open(&store, age, &mut batch).unwrap();
        let again = commands.decide("c", true, &request, 1_000_500, &mut batch);
        assert_eq!(outcome(&again), ("report", why.into()));
        let next = write(r#"{"id":"b"}"#, 1_000_001);
        assert_eq!(outcome(&commands.decide("c", true, &next, 1_000_500, &mut batch)).0, "give");
    }

    #[test]
    fn what_is_no_command_is_refused_with_advice() {
        let folder = tempfile::tempdir().unwrap();
        let (store, mut batch) = (Store::open(&folder.path().join("store"), 9).unwrap(), Batch::default());
        let (mut commands, _) = Commands::open(&store, Duration::from_secs(30), &mut batch).unwrap();
        let mut decide = |payload: &Payload, allowed| {
            let decision = commands.decide("c", allowed, payload, 100_000, &mut batch);
            let (kind, text) = outcome(&decision);
            format!("{kind} {text}")
        };
        let id = "strange Command/Request has no \"id\": give a text of 1 to 64 bytes, each once";
        assert_eq!(decide(&write("{}", 100_000), true), id);
        assert_eq!(decide(&write(r#"{"id":""}"#, 100_000), true), id);
        assert!(
            decide(&write("[]", 100_000), true).starts_with("strange Command/Request is no object of JSON: ")
        );
        assert_eq!(
            decide(&Payload::default(), true),
            "strange write the metric Command/Request, and no other"
        );
        let mut late = write(r#"{"id":"b"}"#, 69_999);
        assert!(
            decide(&late, true)
                .starts_with("report b refused: its time 69999 is more than 30 s from now, 100000")
        );
        assert!(decide(&write(r#"{"id":"b"}"#, 130_001), true).starts_with("report b refused: its time"));
        late.metrics[0].timestamp = None;
        late.timestamp = None;
        assert_eq!(decide(&late, true), "report b refused: it has no time");
        let allowed = "report b refused: the hall's file does not allow commands to this cell";
        assert_eq!(decide(&write(r#"{"id":"b"}"#, 100_000), false), allowed);
        assert_eq!(decide(&write(r#"{"id":"b"}"#, 70_000), true), "give b accepted: ");
    }
}
