//! The result of a demo: a table for people, an object for programs, and whether the link kept its promises.

use core::fmt;
use std::time::Duration;

use comfy_table::{CellAlignment, ContentArrangement, Table, presets::UTF8_FULL_CONDENSED};
use serde_json::{Map, Value, json};

use crate::io::samples::Samples;
use cellwire_io::output::{counted, terminal_columns};
use cellwire_sim::ledger::Counts;

/// The result of one link's demo.
#[derive(Debug, Default)]
pub struct Report {
    title: String,
    object: Map<String, Value>,
    facts: Vec<(String, String)>,
    timings: Vec<Timing>,
    /// Deadlines that were missed, beside the timings.
    missed: Vec<String>,
    failures: Vec<String>,
    link: String,
    moves: &'static str,
    done: ExecutedWork,
}

/// The jobs or messages of a run that were executed.
#[derive(Debug, Clone, Copy)]
pub enum ExecutedWork {
    /// Jobs, each of them once; of those that were executed once, this many had other values than were sent.
    Jobs(Counts, u64),
    /// The messages of a stream, in order.
    Stream {
        /// The number of messages that came.
        done: u64,
        /// The number of messages that did not come.
        lost: u64,
        /// The next message brings the same values, so that one may be lost.
        may_lose: bool,
    },
}

impl Default for ExecutedWork {
    fn default() -> Self {
        Self::Jobs(Counts::default(), 0)
    }
}

/// A row of times.
#[derive(Debug)]
struct Timing {
    key: String,
    label: String,
    count: u64,
    p50: Duration,
    p99: Duration,
    max: Duration,
    /// The value that is compared with the budget: [`Samples::judged`].
    judged: Duration,
    budget: Option<Budget>,
}

/// The time that the source allows, for the p99 of a timing.
#[derive(Debug, Clone, Copy)]
pub struct Budget {
    /// The longest time that the source allows.
    pub time: Duration,
    /// The section of the source.
    pub source: &'static str,
}

impl Report {
    /// Creates an empty report. `title` describes the run in one line.
    pub fn new(link: &str, title: impl Into<String>) -> Self {
        Self { title: format!("{link}: {}", title.into()), link: link.into(), ..Self::default() }
    }

    /// Adds a row of the table, and a field of the object.
    pub fn fact(&mut self, key: &str, label: &str, value: impl Into<Value>) {
        let value = value.into();
        let text = match &value {
            Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        self.facts.push((label.into(), text));
        self.object.insert(key.into(), value);
    }

    /// Adds a field of the object alone.
    pub fn field(&mut self, key: &str, value: Value) {
        self.object.insert(key.into(), value);
    }

    /// Sets the sentence about the moving device, for the table of all links.
    #[must_use]
    pub fn moves(mut self, moves: &'static str) -> Self {
        self.moves = moves;
        self
    }

    /// Returns the link, the moving device, and the executed work.
    pub fn summary(&self) -> (&str, &'static str, ExecutedWork) {
        (&self.link, self.moves, self.done)
    }

    /// Adds the messages of a stream.
    pub fn stream(&mut self, done: u64, lost: u64, may_lose: bool) {
        self.done = ExecutedWork::Stream { done, lost, may_lose };
    }

    /// Adds the jobs of the run, and the number of those that were executed once with other values than were sent. Jobs that
    /// were lost, repeated, or executed although they were reported as not executed, are failures; jobs that the link
    /// reported as unknown are not.
    pub fn jobs(&mut self, jobs: Counts, altered: u64) {
        self.done = ExecutedWork::Jobs(jobs, altered);
        self.fact("sent", "jobs sent", jobs.sent);
        self.fact("executed_once", "executed once", jobs.executed_once);
        self.fact("lost", "lost", jobs.lost);
        self.fact("repeated", "repeated", jobs.repeated);
        if jobs.unknown > 0 {
            self.fact("unknown", "reported as unknown", jobs.unknown);
            self.fact("unknown_executed", "of these executed", jobs.unknown_executed);
        }
        self.require(jobs.lost == 0, || format!("{} lost", were(jobs.lost, "job")));
        self.require(jobs.repeated == 0, || {
            format!("{} executed more than once", were(jobs.repeated, "job"))
        });
        self.require(jobs.unreported == 0, || {
            format!("{} executed after the link had reported the opposite", were(jobs.unreported, "job"))
        });
    }

    /// Adds a row with p50, p99, max and the budget. A p99 above the budget is reported; it is not a failure, because other
    /// programs on a shared computer can cause it. In a short run, where the p99 is nearly the maximum, three samples may be
    /// above the budget.
    pub fn timing(&mut self, key: &str, label: &str, samples: &Samples, budget: Option<Budget>) {
        self.timings.push(Timing {
            key: key.into(),
            label: label.into(),
            count: samples.count(),
            p50: samples.at(0.5),
            p99: samples.at(0.99),
            max: samples.max(),
            judged: samples.judged(),
            budget,
        });
    }

    /// Takes all the time away that budgets allow, to show that times can fail.
    pub fn allow_no_time(&mut self) {
        for budget in self.timings.iter_mut().filter_map(|timing| timing.budget.as_mut()) {
            budget.time = Duration::ZERO;
        }
    }

    /// Adds a failure if a promise was not kept.
    pub fn require(&mut self, kept: bool, failure: impl FnOnce() -> String) {
        if !kept {
            self.failures.push(failure());
        }
    }

    /// Adds a missed deadline, as a p99 above its budget is one, if it was not kept.
    pub fn in_time(&mut self, kept: bool, missed: impl FnOnce() -> String) {
        if !kept {
            self.missed.push(missed());
        }
    }

    /// Returns whether all checks passed.
    pub fn is_good(&self) -> bool {
        self.failures.is_empty()
    }

    /// Returns whether every deadline was met.
    pub fn is_in_time(&self) -> bool {
        self.over_budget().next().is_none()
    }

    /// Returns the time that is nearest to its budget, or furthest beyond it.
    pub fn nearest(&self) -> Option<(Duration, Budget)> {
        let timings = self.timings.iter().filter_map(|timing| Some((timing.judged, timing.budget?)));
        let share =
            |(time, budget): &(Duration, Budget)| time.as_secs_f64() / budget.time.as_secs_f64().max(1e-9);
        timings.max_by(|one, other| share(one).total_cmp(&share(other)))
    }

    /// Returns the failed checks.
    pub fn failures(&self) -> &[String] {
        &self.failures
    }

    /// Returns the deadlines that were missed: times beyond their budgets, and missing times.
    pub fn over_budget(&self) -> impl Iterator<Item = String> + '_ {
        let timings = self.timings.iter().filter_map(|timing| {
            let budget = timing.budget.filter(|budget| timing.judged > budget.time)?;
            let (label, p99, time) = (&timing.label, show(timing.p99), show(budget.time));
            Some(format!("{label}: p99 is {p99}, the budget {time} ({})", budget.source))
        });
        timings.chain(self.missed.iter().cloned())
    }

    /// Returns the title and the tables, without the verdict.
    pub fn figures(&self) -> impl fmt::Display + '_ {
        Figures(self)
    }

    /// Returns all figures as one object.
    pub fn to_json(&self) -> Value {
        let mut object = self.object.clone();
        object.extend(self.timings.iter().map(|timing| (timing.key.clone(), timing.to_json())));
        Value::Object(object)
    }
}

/// Returns the verb after a number of things.
pub fn was<N: PartialEq + From<u8>>(number: N) -> &'static str {
    if number == N::from(1) { "was" } else { "were" }
}

/// Returns a number of things, with its verb: `1 job was`, `2 jobs were`.
pub fn were(number: u64, what: &str) -> String {
    format!("{} {}", counted(number, what), was(number))
}

/// Returns a number of times: `once`, `2 times`.
pub fn times(number: u64) -> String {
    if number == 1 { "once".into() } else { format!("{number} times") }
}

impl Timing {
    fn to_json(&self) -> Value {
        let mut object = json!({
            "count": self.count, "p50_us": micros(self.p50), "p99_us": micros(self.p99), "max_us": micros(self.max)
        });
        if let (Some(object), Some(budget)) = (object.as_object_mut(), self.budget) {
            object.insert("budget_us".into(), json!(micros(budget.time)));
            object.insert("margin_us".into(), json!((self.margin(budget) * 1e6).round()));
        }
        object
    }

    fn row(&self) -> [String; 6] {
        let (limit, margin) = match self.budget {
            None => ("–".into(), "–".into()),
            Some(budget) => (
                format!("{} ({})", show(budget.time), budget.source),
                format!("{:.2} ms", self.margin(budget) * 1e3),
            ),
        };
        [self.label.clone(), show(self.p50), show(self.p99), show(self.max), limit, margin]
    }

    /// Returns the unused part of the budget, in seconds; negative when it is exceeded.
    fn margin(&self, budget: Budget) -> f64 {
        budget.time.as_secs_f64() - self.judged.as_secs_f64()
    }
}

/// Fits a table into this many columns; with `None`, as in a pipe, each row is one line.
pub fn fit(table: &mut Table, columns: Option<usize>) {
    if let Some(columns) = columns {
        table.set_content_arrangement(ContentArrangement::Dynamic);
        table.set_width(u16::try_from(columns).unwrap_or(u16::MAX));
    }
}

/// The title and the tables of a report.
struct Figures<'a>(&'a Report);

impl fmt::Display for Figures<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let report = self.0;
        writeln!(f, "{}", report.title)?;
        if !report.facts.is_empty() {
            let mut table = Table::new();
            table.load_style(UTF8_FULL_CONDENSED);
            fit(&mut table, terminal_columns());
            for (label, value) in &report.facts {
                table.add_row([label, value]);
            }
            right_align(&mut table, 1);
            writeln!(f, "{table}")?;
        }
        if !report.timings.is_empty() {
            let mut table = Table::new();
            fit(&mut table, terminal_columns());
            table
                .load_style(UTF8_FULL_CONDENSED)
                .set_header(["time", "p50", "p99", "max", "budget", "margin"]);
            for timing in &report.timings {
                table.add_row(timing.row());
            }
            (1..6).for_each(|column| right_align(&mut table, column));
            writeln!(f, "{table}")?;
        }
        Ok(())
    }
}

fn right_align(table: &mut Table, index: usize) {
    if let Some(column) = table.column_mut(index) {
        column.set_cell_alignment(CellAlignment::Right);
    }
}

/// Returns a time in whole microseconds.
pub fn micros(time: Duration) -> u64 {
    u64::try_from(time.as_micros()).unwrap_or(u64::MAX)
}

/// Returns a value that is rounded to tenths.
pub fn tenths(value: f64) -> f64 {
    (value * 10.0).round() / 10.0
}

fn show(time: Duration) -> String {
    if time < Duration::from_micros(100) {
        return format!("{} µs", time.as_micros());
    }
    format!("{:.2} ms", time.as_secs_f64() * 1e3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn in_a_short_run_three_samples_may_exceed_the_budget() {
        for (count, late) in [(70, 3), (400, 4), (1000, 10)] {
            let mut samples = Samples::default();
            (late..count).for_each(|_| samples.add(Duration::from_millis(1)));
            (0..late).for_each(|_| samples.add(Duration::from_millis(9)));
            let budget = Some(Budget { time: Duration::from_millis(5), source: "§1" });
            let mut report = Report::new("x", "y");
            report.timing("t", "t", &samples, budget);
            assert!(report.is_in_time(), "{late} of {count}");
            samples.add(Duration::from_millis(9));
            report.timing("t", "t", &samples, budget);
            assert!(!report.is_in_time(), "one more than {late} of {count}");
        }
    }

    #[test]
    fn a_late_p99_is_reported_and_a_lost_job_is_a_failure() {
        let mut samples = Samples::default();
        (1..=100).for_each(|ms| samples.add(Duration::from_millis(ms)));
        let mut report = Report::new("x", "y");
        report.timing(
            "turn_around",
            "turn-around",
            &samples,
            Some(Budget { time: Duration::from_millis(110), source: "§9.4" }),
        );
        assert!(report.is_in_time());
        report.timing(
            "turn_around",
            "turn-around",
            &samples,
            Some(Budget { time: Duration::from_millis(90), source: "§9.4" }),
        );
        assert!(report.is_good() && !report.is_in_time());
        assert_eq!(report.to_json()["turn_around"]["margin_us"], -7_023.0);
        report.jobs(Counts { sent: 2, executed_once: 1, lost: 1, ..Counts::default() }, 0);
        assert_eq!(report.failures(), ["1 job was lost"]);
        let over: Vec<String> = report.over_budget().collect();
        assert_eq!(over, ["turn-around: p99 is 99.01 ms, the budget 90.00 ms (§9.4)"]);
        let (time, budget) = report.nearest().unwrap();
        assert!(time > budget.time && budget.time == Duration::from_millis(90));
    }
}
