//! The differences that were found: the first of each kind, and counts.

use anyhow::Result;
use serde_json::{Map, Value, json};

use super::PRINTED;
use cellwire_io::output;

/// The kinds of differences, and their names for people.
const KINDS: [(&str, &str); 7] = [
    ("values", "with other values"),
    ("command", "with other numbers of a command"),
    ("other", "other"),
    ("missing", "missing"),
    ("again", "sent again"),
    ("later", "later"),
    ("more", "more than expected"),
];

/// The kind that is not a departure.
const VALUES: &str = "values";

/// The differences so far.
#[derive(Debug, Default)]
pub(super) struct Report {
    prints_all: bool,
    /// Counts of [`KINDS`].
    counts: [usize; KINDS.len()],
    /// The departures with the lowest numbers, for people.
    lowest: Vec<Value>,
    /// The first departure, and the message before it.
    first: Option<(Value, Option<Value>)>,
    left_out: usize,
}

impl Report {
    pub(super) fn new(prints_all: bool) -> Self {
        Self { prints_all, ..Self::default() }
    }

    /// Adds a difference, and prints its line if it is among the first of its kind. `before` is the expected message before it.
    pub(super) fn add(&mut self, kind: &'static str, line: Value, before: Option<&Value>) -> Result<()> {
        let at = KINDS.iter().position(|(known, _)| *known == kind).unwrap_or_default();
        let count = self.counts.get_mut(at).map_or(0, |count| {
            *count += 1;
            *count
        });
        let number = |line: &Value| line.get("number").and_then(Value::as_u64);
        if kind != VALUES {
            if self.first.as_ref().is_none_or(|(first, _)| number(&line) < number(first)) {
                self.first = Some((line.clone(), before.cloned()));
            }
            let at = self.lowest.partition_point(|it| number(it) <= number(&line));
            self.lowest.insert(at, line.clone());
            self.lowest.truncate(PRINTED + 1);
        }
        if !self.prints_all && count > PRINTED {
            self.left_out += 1;
            return Ok(());
        }
        if output::is_for_people() && !self.prints_all { Ok(()) } else { output::log(&line) }
    }

    pub(super) fn count(&self, kind: &str) -> usize {
        let counts = KINDS.iter().zip(self.counts);
        counts.filter(|((known, _), _)| *known == kind).map(|(_, count)| count).sum()
    }

    /// Returns the number of differences other than in values.
    pub(super) fn departures(&self) -> usize {
        self.counts.iter().sum::<usize>() - self.count(VALUES)
    }

    /// Prints the counts, the first departure with the message before it, and how many lines were left out.
    pub(super) fn print(&self, event: &str, counts: &[(&str, usize)]) -> Result<()> {
        if output::is_for_people() {
            return self.lines(event, counts).into_iter().try_for_each(|line| output::log(&line.into()));
        }
        let mut all = Map::from_iter([("event".to_owned(), json!(event))]);
        all.extend(counts.iter().map(|(name, count)| ((*name).to_owned(), json!(count))));
        all.insert(VALUES.into(), self.count(VALUES).into());
        all.insert("departures".into(), self.departures().into());
        for (kind, _) in KINDS.iter().filter(|(kind, _)| *kind != VALUES && self.count(kind) > 0) {
            all.insert((*kind).to_owned(), self.count(kind).into());
        }
        if let Some((first, before)) = &self.first {
            let mut first = first.clone();
            if let (Some(fields), Some(before)) = (first.as_object_mut(), before) {
                fields.insert("before".into(), before.clone());
            }
            all.insert("first".into(), first);
        }
        if self.left_out > 0 {
            all.insert("left_out".into(), self.left_out.into());
        }
        output::log(&all.into())
    }

    /// Returns the report for people.
    fn lines(&self, event: &str, counts: &[(&str, usize)]) -> Vec<String> {
        let counted = counts.iter().map(|(name, count)| format!("{name} {count}"));
        let kinds = KINDS.iter().filter(|(kind, _)| self.count(kind) > 0);
        let kinds = kinds.map(|(kind, words)| format!("{words} {}", self.count(kind)));
        let all = counted.chain(kinds).collect::<Vec<_>>().join(", ").replace(", of ", " of ");
        let mut lines = vec![format!("{event}: {all}")];
        let Some((first, before)) = &self.first else { return lines };
        let shown = |line: &Value| {
            let words = line.get("departure").and_then(Value::as_str).unwrap_or_default();
            let words = KINDS.iter().find(|(kind, _)| *kind == words).map_or(words, |(_, words)| words);
            format!("message {} {words}", line.get("number").unwrap_or(&Value::Null))
        };
        lines.push(format!("first departure: {}", shown(first)));
        let [then, now] = ["then", "now"].map(|key| first.get(key));
        for (what, message) in [("before", before.as_ref()), ("expected", then), ("received", now)] {
            lines.extend(message.map(|message| format!("  {what:8} {message}")));
        }
        for line in self.lowest.iter().filter(|line| *line != first).take(PRINTED) {
            let message = line.get("now").or_else(|| line.get("then")).unwrap_or(&Value::Null);
            lines.push(format!("then: {} {message}", shown(line)));
        }
        match self.departures().saturating_sub(PRINTED + 1) {
            0 => {}
            more => lines.push(format!("and {more} more: --all prints each")),
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_has_counts_the_first_departure_and_a_few_more() {
        let mut report = Report::default();
        for number in (2..=20).rev() {
            report
                .add("missing", json!({"departure": "missing", "number": number, "then": "b"}), None)
                .unwrap();
        }
        let other = json!({"departure": "other", "number": 1, "then": "a", "now": "c", "at": 0.5});
        report.add("other", other, Some(&json!("start"))).unwrap();
        let expected = [
            "replayed: sent 1 of 2, expected 21, other 1, missing 19",
            "first departure: message 1 other",
            "  before   \"start\"",
            "  expected \"a\"",
            "  received \"c\"",
            "then: message 2 missing \"b\"",
            "then: message 3 missing \"b\"",
            "then: message 4 missing \"b\"",
            "then: message 5 missing \"b\"",
            "then: message 6 missing \"b\"",
            "and 14 more: --all prints each",
        ];
        assert_eq!(report.lines("replayed", &[("sent", 1), ("of", 2), ("expected", 21)]), expected);
    }
}
