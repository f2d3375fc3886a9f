//! Where an end departs from what it did then.

mod follow;

use std::time::Duration;

use anyhow::Result;
use serde_json::{Value, json};

use self::follow::Follow;
use crate::io::output;

/// How many messages may be missing before one that is known again.
const AHEAD: usize = 8;

/// Compares the messages of the other end with those that it sent then.
#[derive(Debug)]
pub(super) struct Compare {
    expected: Vec<Value>,
    /// How many of them have come, or will not.
    pub(super) passed: usize,
    /// Those that have not come when later ones did.
    outstanding: Vec<usize>,
    same: usize,
    /// The same messages with other values.
    values: usize,
    departures: usize,
    pub(super) follow: Follow,
}

impl Compare {
    pub(super) fn new(expected: Vec<Value>) -> Self {
        Self {
            expected,
            passed: 0,
            outstanding: Vec::new(),
            same: 0,
            values: 0,
            departures: 0,
            follow: Follow::default(),
        }
    }

    /// Whether nothing more is expected.
    pub(super) fn is_over(&self) -> bool {
        self.passed >= self.expected.len()
    }

    /// A message has come.
    pub(super) fn take(&mut self, at: Duration, now: &Value) -> Result<()> {
        let rest = self.expected.get(self.passed..).unwrap_or_default();
        if rest.first() == Some(now) {
            (self.passed, self.same) = (self.passed + 1, self.same + 1);
            return Ok(());
        }
        if let Some(place) = self.outstanding.iter().position(|index| self.expected.get(*index) == Some(now))
        {
            let index = self.outstanding.remove(place);
            return self.tell("later", index, None, at, Some(now));
        }
        let number = self.passed;
        let Some(then) = rest.first() else { return self.tell("more", number, None, at, Some(now)) };
        let ahead = || rest.iter().take(AHEAD);
        // What is there once is known again.
        let known = ahead().position(|it| it == now);
        let known = known.filter(|_| self.expected.iter().filter(|it| *it == now).count() == 1);
        let alike = || ahead().position(|it| is_alike(it, now));
        let before = self.passed.checked_sub(1).and_then(|before| self.expected.get(before));
        if !is_alike(then, now) && before == Some(now) {
            return self.tell("again", number, None, at, Some(now));
        }
        match known.or_else(alike) {
            Some(missing) => {
                self.missed(missing);
                let then = self.expected.get(self.passed).cloned().unwrap_or_default();
                if then == *now {
                    self.same += 1;
                } else {
                    self.follow.learn(&then, now);
                    self.tell("values", self.passed, Some(&then), at, Some(now))?;
                }
            }
            None => {
                let then = then.clone();
                self.tell("other", number, Some(&then), at, Some(now))?;
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
        what: &str,
        index: usize,
        then: Option<&Value>,
        at: Duration,
        now: Option<&Value>,
    ) -> Result<()> {
        match what {
            "values" => self.values += 1,
            _ => self.departures += 1,
        }
        let mut line = json!({"departure": what, "number": index + 1});
        if let Some(fields) = line.as_object_mut() {
            if let Some(then) = then {
                fields.insert("then".into(), then.clone());
            }
            if let Some(now) = now {
                fields.insert("at".into(), at.as_secs_f64().into());
                fields.insert("now".into(), now.clone());
            }
        }
        output::log(&line)
    }

    /// What has not come does not come any more.
    fn end(&mut self) -> Result<()> {
        self.missed(self.expected.len().saturating_sub(self.passed));
        for index in std::mem::take(&mut self.outstanding) {
            let then = self.expected.get(index).cloned();
            self.tell("missing", index, then.as_ref(), Duration::ZERO, None)?;
        }
        Ok(())
    }

    /// Nothing more comes: what is said of all of it, and whether the end did what it did then.
    ///
    /// # Errors
    /// When standard output is closed.
    pub(super) fn finish(mut self) -> Result<(Value, bool)> {
        self.end()?;
        let Self { expected, same, values, departures, .. } = self;
        let expected = expected.len();
        let all = json!({"expected": expected, "same": same, "values": values, "departures": departures});
        Ok((all, departures == 0))
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
        let mut compare = Compare::new(then.to_vec());
        now.iter().for_each(|now| compare.take(Duration::ZERO, now).unwrap());
        compare.end().unwrap();
        [compare.passed, compare.same, compare.values, compare.departures]
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
}
