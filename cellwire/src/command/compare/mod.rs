//! The differences of an end from its recorded behaviour.

mod follow;
mod report;

use std::time::Duration;

use anyhow::Result;
use serde_json::{Value, json};

pub(super) use self::follow::{Follow, IsCommand};
use self::report::Report;

/// The number of messages that may be missing before one that is known again.
const MAX_MISSING: usize = 8;

/// The differences of each kind that are printed.
const PRINTED: usize = 5;

/// Compares the messages of the other end with those that it sent then.
#[allow(missing_debug_implementations, reason = "a codec has none")]
pub(super) struct Compare {
    expected: Vec<Value>,
    /// For each of them, whether it has no content: then it is not compared.
    fillers: Vec<bool>,
    /// The number of messages without content that have come.
    filled: usize,
    /// How many of them have come, or will not.
    pub(super) passed: usize,
    /// The messages that have not come although later ones have.
    outstanding: Vec<usize>,
    same: usize,
    report: Report,
    pub(super) follow: Follow,
}

impl Compare {
    /// Creates a comparison. With `prints_all` each difference is printed, not only the first of each kind.
    pub(super) fn new(expected: Vec<Value>, follow: Follow, prints_all: bool) -> Self {
        Self {
            fillers: expected.iter().map(|message| follow.is_filler(message)).collect(),
            filled: 0,
            expected,
            passed: 0,
            outstanding: Vec::new(),
            same: 0,
            report: Report::new(prints_all),
            follow,
        }
    }

    /// Returns whether no more messages are expected.
    pub(super) fn is_over(&self) -> bool {
        self.awaits_only_fillers(self.expected.len())
    }

    /// Returns whether the expected ones of the first `count` messages all lack content.
    pub(super) fn awaits_only_fillers(&self, count: usize) -> bool {
        self.fillers.get(self.passed..count).unwrap_or_default().iter().all(|is_filler| *is_filler)
    }

    fn is_filler(&self, index: usize) -> bool {
        self.fillers.get(index).copied().unwrap_or_default()
    }

    /// Called when a message has come.
    pub(super) fn take(&mut self, at: Duration, now: &Value) -> Result<()> {
        if self.follow.is_filler(now) {
            self.filled += 1;
            self.passed += usize::from(self.is_filler(self.passed));
            return Ok(());
        }
        while self.is_filler(self.passed) {
            self.passed += 1;
        }
        let rest = self.expected.get(self.passed..).unwrap_or_default();
        let is_same = |then: &Value| self.follow.is_same(then, now);
        if rest.first().is_some_and(is_same) {
            (self.passed, self.same) = (self.passed + 1, self.same + 1);
            return Ok(());
        }
        let late = |index: &usize| self.expected.get(*index).is_some_and(is_same);
        if let Some(place) = self.outstanding.iter().position(late) {
            let index = self.outstanding.remove(place);
            return self.tell("later", index, None, Some((at, now)));
        }
        let number = self.passed;
        let Some(then) = rest.first() else { return self.tell("more", number, None, Some((at, now))) };
        let is_filler = |at: &(usize, &Value)| self.is_filler(number + at.0);
        let ahead = || rest.iter().enumerate().filter(|it| !is_filler(it)).take(MAX_MISSING);
        // A message that is in the capture once is known again.
        let is_once = || self.expected.iter().filter(|it| is_same(it)).nth(1).is_none();
        let place = |is: &dyn Fn(&Value) -> bool| ahead().find(|(_, it)| is(it)).map(|(at, _)| at);
        let known = || place(&is_same).filter(|_| is_once());
        let alike = || place(&|it| is_alike(it, now));
        let before = self.before(number);
        if !is_alike(then, now) && before.is_some_and(is_same) {
            return self.tell("again", number, None, Some((at, now)));
        }
        match known().or_else(alike) {
            Some(missing) => {
                self.missed(missing);
                let then = self.expected.get(self.passed).cloned().unwrap_or_default();
                if self.follow.is_same(&then, now) {
                    self.same += 1;
                } else {
                    let is_command = self.follow.differs_in_command(&then, now);
                    self.follow.learn(&then, now);
                    let kind = if is_command { "command" } else { "values" };
                    self.tell(kind, self.passed, Some(&then), Some((at, now)))?;
                }
            }
            None => {
                let then = then.clone();
                self.tell("other", number, Some(&then), Some((at, now)))?;
            }
        }
        self.passed += 1;
        Ok(())
    }

    /// Called when these messages have not come so far.
    pub(super) fn missed(&mut self, count: usize) {
        for index in self.passed..self.passed + count {
            if !self.is_filler(index) {
                self.outstanding.push(index);
            }
        }
        self.passed += count;
    }

    /// Returns the last expected message with content before this index.
    fn before(&self, index: usize) -> Option<&Value> {
        let before = (0..index).rev().find(|index| !self.is_filler(*index))?;
        self.expected.get(before)
    }

    fn tell(
        &mut self,
        kind: &'static str,
        index: usize,
        then: Option<&Value>,
        now: Option<(Duration, &Value)>,
    ) -> Result<()> {
        let mut line = json!({"departure": kind, "number": index + 1});
        if let Some(fields) = line.as_object_mut() {
            if let Some(then) = then {
                fields.insert("then".into(), then.clone());
            }
            if let Some((at, now)) = now {
                fields.insert("at".into(), at.as_secs_f64().into());
                fields.insert("now".into(), now.clone());
            }
        }
        let before = self.before(index).cloned();
        self.report.add(kind, line, before.as_ref())
    }

    /// Reports the messages that have not come as missing.
    fn end(&mut self) -> Result<()> {
        self.missed(self.expected.len().saturating_sub(self.passed));
        for index in std::mem::take(&mut self.outstanding) {
            let then = self.expected.get(index).cloned();
            self.tell("missing", index, then.as_ref(), None)?;
        }
        Ok(())
    }

    /// Called when no more messages come: prints the report, whose first counts are `counts`, and returns whether the end
    /// did the same as in the recording.
    ///
    /// # Errors
    /// If standard output is closed.
    pub(super) fn finish(mut self, event: &str, counts: &[(&str, usize)]) -> Result<bool> {
        self.end()?;
        let expected = self.fillers.iter().filter(|is_filler| !**is_filler).count();
        let mut counts = [counts, &[("expected", expected), ("same", self.same)]].concat();
        if self.filled > 0 || expected < self.expected.len() {
            counts.push(("fillers", self.filled));
        }
        self.report.print(event, &counts)?;
        Ok(self.report.departures() == 0)
    }
}

/// Returns whether two messages differ only in values: numbers, numbers as text, and booleans.
fn is_alike(then: &Value, now: &Value) -> bool {
    let is_number = |text: &str| text.parse::<f64>().is_ok();
    match (then, now) {
        (Value::Number(_), Value::Number(_)) | (Value::Bool(_), Value::Bool(_)) => true,
        (Value::String(a), Value::String(b)) => a == b || is_number(a) && is_number(b),
        (Value::Array(a), Value::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(then, now)| is_alike(then, now))
        }
        (Value::Object(a), Value::Object(b)) => {
            a.len() == b.len()
                && a.iter().all(|(name, then)| b.get(name).is_some_and(|now| is_alike(then, now)))
        }
        _ => then == now,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn compared(then: &[Value], now: &[Value]) -> [usize; 4] {
        let mut compare = Compare::new(then.to_vec(), Follow::default(), false);
        now.iter().for_each(|now| compare.take(Duration::ZERO, now).unwrap());
        compare.end().unwrap();
        [compare.passed, compare.same, compare.report.count("values"), compare.report.departures()]
    }

    #[test]
    fn departures_are_told_from_values() {
        let message = |name: &str, n: u8| json!({"name": name, "fields": [n.to_string()]});
        let then: Vec<Value> = (0..6).map(|n| message(if n % 2 == 0 { "a" } else { "b" }, n)).collect();
        assert_eq!(compared(&then, &then), [6, 6, 0, 0]);
        let mut now = then.clone();
        now[2] = message("a", 9);
        assert_eq!(compared(&then, &now), [6, 5, 1, 0]);
        now[2] = message("c", 2);
        assert_eq!(compared(&then, &now), [6, 5, 0, 1]);
        now.remove(2);
        assert_eq!(compared(&then, &now), [6, 5, 0, 1], "one is missing");
        now = then.clone();
        now.insert(2, then[1].clone());
        assert_eq!(compared(&then, &now), [6, 6, 0, 1], "one came again");
        now = then.clone();
        now.swap(2, 3);
        assert_eq!(compared(&then, &now), [6, 5, 0, 1], "two in another order");
        now.swap(2, 3);
        now.push(message("d", 1));
        assert_eq!(compared(&then, &now), [6, 6, 0, 1], "one more");
    }

    #[test]
    fn messages_without_content_are_left_out() {
        let codec = (cellwire_links::Link::by_name("kawasaki").unwrap().codec)("pc", &Default::default());
        let message = |name: &str, fields: &[&str]| json!({"name": name, "header": [], "fields": fields});
        let filler = message("Huuhaa", &[]);
        let job = |n: &str| message("Tyo", &["4", n, "1", "2", "3", "4", "5"]);
        let then =
            [filler.clone(), job("1"), filler.clone(), filler.clone(), job("2"), job("3"), filler.clone()];
        let mut compare = Compare::new(then.to_vec(), Follow::new(Some(codec.unwrap())), false);
        assert!(compare.awaits_only_fillers(1) && !compare.awaits_only_fillers(2));
        for now in [job("1"), filler.clone(), job("2"), filler.clone(), filler, job("3")] {
            compare.take(Duration::ZERO, &now).unwrap();
        }
        assert!(compare.is_over());
        compare.end().unwrap();
        assert_eq!((compare.same, compare.filled, compare.report.departures()), (3, 3, 0));
    }

    #[test]
    fn a_number_that_commands_departs_unless_it_is_one_that_the_end_chooses() {
        let message = |id: u8, value: u8| json!({"transaction": id, "values": [value]});
        let compared = |is_command: Option<IsCommand>| {
            let follow = Follow::default().of_commands(is_command);
            let mut compare = Compare::new((1..4).map(|id| message(id, 20)).collect(), follow, false);
            for now in [message(7, 20), message(8, 21), message(9, 20)] {
                compare.take(Duration::ZERO, &now).unwrap();
            }
            [compare.report.count("values"), compare.report.count("command"), compare.report.departures()]
        };
        assert_eq!(compared(None), [3, 0, 0]);
        assert_eq!(compared(Some(|name| name != "transaction")), [2, 1, 1]);
    }

    #[test]
    fn a_message_with_the_number_that_was_chosen_is_the_same() {
        let message = |order: u16, number: u8| json!({"order": order, "number": number});
        let then: Vec<Value> = (1..6).map(|number| message(7, number)).collect();
        let now: Vec<Value> = (1..6).map(|number| message(9, number)).collect();
        assert_eq!(compared(&then, &now), [5, 4, 1, 0]);
    }
}
