//! The screen of `cellwire demo`: a row for each link, and what they mean together.

use core::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::{Value, json};

use crate::report::{Done, Report};
use cellwire_io::output::counted;
use cellwire_sim::ledger::Counts;

/// The columns of a screen.
const WIDTH: usize = 80;
/// Where the text of a failure begins.
const INDENT: usize = 5;

/// The head of the table.
pub const HEAD: &str = "     link      what moves               done  lost twice  deadline used, allowed\n";

/// The legend of the columns.
pub const LEGEND: &str = "\
done: executed, as the simulated robot counted; of a stream, messages in order.
(n): may be lost, the next message brings the same values.  -: has no jobs.
used: 99 of 100 answers took no longer.  allowed: by the link's source.
";

/// The demo of a link, judged.
#[derive(Debug)]
pub struct Judged {
    /// The measurements.
    pub report: Report,
    /// Whether a time above its budget is a failure.
    pub check_times: bool,
    /// Where the picture is.
    pub picture: Option<PathBuf>,
}

impl Judged {
    /// Whether nothing failed.
    pub fn is_good(&self) -> bool {
        self.report.is_good() && (self.report.is_in_time() || !self.check_times)
    }

    /// The row, and below it why it has failed and how that is seen again.
    pub fn row(&self, again: &str) -> String {
        let (link, moves, done) = self.report.summary();
        let word = match (self.is_good(), self.report.is_in_time()) {
            (false, _) => "FAIL",
            (true, false) => "LATE",
            (true, true) => "ok",
        };
        let (count, lost, twice) = match done {
            Done::Jobs(jobs) => (jobs.executed_once, jobs.lost.to_string(), jobs.repeated.to_string()),
            Done::Stream { done, lost, may_lose } => {
                let lost = if may_lose && lost > 0 { format!("({lost})") } else { lost.to_string() };
                (done, lost, "-".into())
            }
        };
        let deadline = match self.report.nearest() {
            Some((used, budget)) => {
                let (used, allowed) = (used.as_secs_f64() * 1e3, budget.time.as_secs_f64() * 1e3);
                let bar = "#".repeat(tenths(used, allowed));
                format!("{bar:.<10} {used:4.1} {allowed:3.0} ms")
            }
            None => "none".into(),
        };
        let mut row = format!("{word:<4} {link:<9} {moves:<23}{count:>6} {lost:>5} {twice:>5}  {deadline}\n");
        if !self.is_good() {
            let late = self.report.over_budget().filter(|_| self.check_times);
            for failure in self.report.failures().iter().cloned().chain(late) {
                row.push_str(&wrapped(&format!("{failure}."), INDENT));
            }
            row.push_str(&wrapped(again, INDENT));
        }
        row
    }

    /// The same as an object of the same keys for every link.
    pub fn to_json(&self) -> Value {
        let (link, _, done) = self.report.summary();
        let (done, lost, repeated, unknown) = match done {
            Done::Jobs(jobs) => (jobs.executed_once, jobs.lost, Some(jobs.repeated), jobs.unknown),
            Done::Stream { done, lost, .. } => (done, lost, None, 0),
        };
        let micros = |time: Duration| u64::try_from(time.as_micros()).unwrap_or(u64::MAX);
        let nearest = self.report.nearest();
        json!({
            "link": link, "ok": self.is_good(), "late": !self.report.is_in_time(), "done": done, "lost": lost,
            "repeated": repeated, "unknown": unknown,
            "used_us": nearest.map(|(used, _)| micros(used)),
            "allowed_us": nearest.map(|(_, budget)| micros(budget.time)),
            "source": nearest.map(|(_, budget)| budget.source), "picture": self.picture,
            "failures": self.report.failures(), "over_budget": self.report.over_budget().collect::<Vec<_>>(),
            "figures": self.report.to_json(),
        })
    }
}

/// How many tenths of what is allowed are used, rounded up; ten at most.
fn tenths(used: f64, allowed: f64) -> usize {
    (1..10).find(|tenth| used <= allowed * f64::from(*tenth) / 10.0).map_or(10, |tenth| tenth as usize)
}

/// The sum of all rows: the jobs, and the deadlines.
pub fn verdict(all: &[Judged]) -> String {
    let mut text = String::new();
    let jobs: Vec<_> = all
        .iter()
        .filter_map(|it| match it.report.summary().2 {
            Done::Jobs(jobs) => Some(jobs),
            Done::Stream { .. } => None,
        })
        .collect();
    let sum = |of: fn(&Counts) -> u64| jobs.iter().map(of).sum::<u64>();
    let [sent, once] = [sum(|it| it.sent), sum(|it| it.executed_once)];
    let [lost, repeated, unknown] = [sum(|it| it.lost), sum(|it| it.repeated), sum(|it| it.unknown)];
    if sent > 0 && lost + repeated + unknown == 0 {
        let _ = writeln!(text, "{sent} jobs were sent. Each was executed exactly once: 0 lost, 0 repeated.");
    } else if sent > 0 {
        let counts = format!(
            "{sent} jobs were sent: {once} executed once, {lost} lost, {repeated} repeated, {unknown} reported as unknown."
        );
        text.push_str(&wrapped(&counts, 0));
    }
    let with_deadline = all.iter().filter(|it| it.report.nearest().is_some()).count();
    let late: Vec<&str> =
        all.iter().filter(|it| !it.report.is_in_time()).map(|it| it.report.summary().0).collect();
    match (late.len(), with_deadline) {
        (_, 0) => {}
        (0, 1) => text.push_str("Its deadline was kept.\n"),
        (0, count) => {
            let _ = writeln!(text, "All {count} deadlines were kept.");
        }
        (missed, count) => {
            let verb = if missed == 1 { "was" } else { "were" };
            let checked = all.iter().any(|it| it.check_times);
            let more = if checked { "" } else { " On a quiet machine --check-times makes that a failure." };
            let names = late.join(", ");
            let deadlines = counted(count, "deadline");
            let line = format!("{missed} of {deadlines} {verb} missed: {names}.{more}");
            text.push_str(&wrapped(&line, 0));
        }
    }
    text
}

/// Where the pictures are.
pub fn pictures(folder: Option<&Path>, all: &[Judged]) -> String {
    let Some(folder) = folder else {
        return "Pictures of what moved: cellwire demo --out FOLDER\n".into();
    };
    let names: Vec<String> = all
        .iter()
        .filter_map(|it| it.picture.as_ref())
        .filter_map(|it| Some(it.file_name()?.to_string_lossy().into_owned()))
        .collect();
    wrapped(&format!("Pictures of what moved, in {}: {}", folder.display(), names.join(" ")), 0)
}

/// A text in lines of a screen's width.
fn wrapped(text: &str, indent: usize) -> String {
    let (mut lines, mut line) = (String::new(), String::new());
    for word in text.split(' ') {
        if !line.is_empty() && indent + line.chars().count() + 1 + word.chars().count() > WIDTH {
            let _ = writeln!(lines, "{:indent$}{line}", "");
            line.clear();
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    let _ = writeln!(lines, "{:indent$}{line}", "");
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::samples::Samples;
    use crate::report::Budget;

    fn judged(link: &str, late: bool, jobs: Option<Counts>) -> Judged {
        let mut report = Report::new(link, "a title").moves("a pen draws a picture");
        match jobs {
            Some(jobs) => report.jobs(jobs),
            None => report.stream(261, 6, true),
        }
        let mut samples = Samples::default();
        samples.add(Duration::from_micros(if late { 56_000 } else { 3_400 }));
        report.timing("t", "t", &samples, Some(Budget { time: Duration::from_millis(28), source: "§3.4" }));
        Judged { report, check_times: false, picture: None }
    }

    #[test]
    fn a_row_says_what_was_done_and_a_late_one_is_not_good_news() {
        let whole = Counts { sent: 7148, executed_once: 7148, ..Counts::default() };
        let good = judged("kawasaki", false, Some(whole));
        assert_eq!(
            good.row("again"),
            "ok   kawasaki  a pen draws a picture    7148     0     0  ##........  3.4  28 ms\n"
        );
        let late = judged("ball", true, None);
        assert_eq!(
            late.row("again"),
            "LATE ball      a pen draws a picture     261   (6)     -  ########## 56.0  28 ms\n"
        );
        let lossy =
            judged("laser", false, Some(Counts { sent: 2, executed_once: 1, lost: 1, ..Counts::default() }));
        assert!(
            lossy
                .row("cellwire demo laser --seed 1 --verbose")
                .ends_with("ms\n     1 job was lost.\n     cellwire demo laser --seed 1 --verbose\n")
        );
        let text = verdict(&[good, late]);
        assert!(
            text.starts_with("7148 jobs were sent. Each was executed exactly once: 0 lost, 0 repeated.\n")
        );
        assert!(
            text.contains("1 of 2 deadlines was missed: ball.") && text.contains("--check-times"),
            "{text}"
        );
        assert!(
            HEAD.len() <= WIDTH + 1 && text.lines().chain(LEGEND.lines()).all(|line| line.len() <= WIDTH)
        );
        let strict = Judged { check_times: true, ..judged("ball", true, None) };
        assert!(!strict.is_good() && strict.row("again").starts_with("FAIL ball"));
    }
}
