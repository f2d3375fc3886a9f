//! Where an end departs from what it did then.

mod follow;
mod report;

use std::time::Duration;

use anyhow::Result;
use serde_json::{Value, json};

pub(super) use self::follow::Follow;
use self::report::Report;

/// How many messages may be missing before one that is known again.
const AHEAD: usize = 8;

/// The differences of each kind that are printed.
const PRINTED: usize = 5;

/// Compares the messages of the other end with those that it sent then.
#[allow(missing_debug_implementations, reason = "a codec has none")]
pub(super) struct Compare {
    expected: Vec<Value>,
    /// How many of them have come, or will not.
    pub(super) passed: usize,
    /// Those that have not come when later ones did.
    outstanding: Vec<usize>,
    same: usize,
    report: Report,
    pub(super) follow: Follow,
}

impl Compare {
    /// `prints_all`: each difference is printed, not only the first of each kind.
    pub(super) fn new(expected: Vec<Value>, follow: Follow, prints_all: bool) -> Self {
        Self {
            expected,
            passed: 0,
            outstanding: Vec::new(),
            same: 0,
            report: Report::new(prints_all),
            follow,
        }
    }

    /// Whether nothing more is expected.
    pub(super) fn is_over(&self) -> bool {
        self.passed >= self.expected.len()
    }

    /// A message has come.
    pub(super) fn take(&mut self, at: Duration, now: &Value) -> Result<()> {
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
        let ahead = || rest.iter().take(AHEAD);
        // A message that is in the capture once is known again.
        let is_once = || self.expected.iter().filter(|it| is_same(it)).nth(1).is_none();
        let known = || ahead().position(is_same).filter(|_| is_once());
        let alike = || ahead().position(|it| is_alike(it, now));
        let before = self.passed.checked_sub(1).and_then(|before| self.expected.get(before));
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
                    self.follow.learn(&then, now);
                    self.tell("values", self.passed, Some(&then), Some((at, now)))?;
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

    /// These messages have not come so far.
    pub(super) fn missed(&mut self, count: usize) {
        self.outstanding.extend(self.passed..self.passed + count);
        self.passed += count;
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
        let before = index.checked_sub(1).and_then(|before| self.expected.get(before));
        self.report.add(kind, line, before)
    }

    /// What has not come does not come any more.
    fn end(&mut self) -> Result<()> {
        self.missed(self.expected.len().saturating_sub(self.passed));
        for index in std::mem::take(&mut self.outstanding) {
            let then = self.expected.get(index).cloned();
            self.tell("missing", index, then.as_ref(), None)?;
        }
        Ok(())
    }

    /// Nothing more comes: prints the report, whose first counts are `counts`, and returns whether the end did what it did then.
    ///
    /// # Errors
    /// When standard output is closed.
    pub(super) fn finish(mut self, event: &str, counts: &[(&str, usize)]) -> Result<bool> {
        self.end()?;
        let matched = [("expected", self.expected.len()), ("same", self.same)];
        self.report.print(event, &[counts, &matched].concat())?;
        Ok(self.report.departures() == 0)
    }
}

/// Whether two messages differ in values alone: numbers, numbers as text, and what is true or false.
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
    fn a_message_with_the_number_that_was_chosen_is_the_same() {
        let message = |order: u16, number: u8| json!({"order": order, "number": number});
        let then: Vec<Value> = (1..6).map(|number| message(7, number)).collect();
        let now: Vec<Value> = (1..6).map(|number| message(9, number)).collect();
        assert_eq!(compared(&then, &now), [5, 4, 1, 0]);
    }
}
