//! The screen of `cellwire demo`: a row for each link, and their common result.

use core::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::report::{ExecutedWork, Report, micros, was, were};
use cellwire_io::output::{counted, wrapped};
use cellwire_sim::ledger::Counts;

/// The columns of a screen, if there is no narrower one.
const WIDTH: usize = 80;
/// The column at which the text of a failure begins.
const INDENT: usize = 5;

/// The columns that the table has room for.
#[derive(Debug, Clone, Copy)]
pub struct Layout {
    width: usize,
}

impl Layout {
    /// Creates the layout for a terminal with this many columns; `None`: a pipe.
    pub fn new(columns: Option<usize>) -> Self {
        Self { width: columns.unwrap_or(WIDTH).min(WIDTH) }
    }

    /// Returns whether the table has the column `what moves`.
    fn has_moves(self) -> bool {
        self.width >= WIDTH
    }

    /// Returns whether the table has a bar of the deadline.
    fn has_bar(self) -> bool {
        self.width >= 57
    }

    /// Returns the head of the table.
    pub fn head(self) -> String {
        let moves = if self.has_moves() { format!("{:<23}", "what moves") } else { String::new() };
        let deadline = if self.has_bar() { "deadline used, allowed" } else { "used, allowed" };
        format!("     link      {moves}  done  lost twice  {deadline}\n")
    }

    /// Returns a text in lines of the layout's width.
    pub fn wrapped(self, text: &str, indent: usize) -> String {
        wrapped(text, self.width, indent)
    }

    /// Returns the legend of the columns, for the signs in the rows.
    pub fn legend(self, all: &[DemoResult]) -> String {
        let done = |is: fn(&ExecutedWork) -> bool| all.iter().any(|it| is(&it.report.summary().2));
        let streams = done(|done| matches!(done, ExecutedWork::Stream { .. }));
        let mut legend = String::from("done: executed, as the simulated robot counted");
        legend.push_str(if streams { "; of a stream, messages in order." } else { "." });
        if done(|done| matches!(done, ExecutedWork::Stream { lost: 1.., may_lose: true, .. })) {
            legend.push_str("\n(n): may be lost, the next message brings the same values.");
        }
        if streams {
            legend.push_str("\n-: has no jobs.");
        }
        if all.iter().any(|it| it.report.nearest().is_some()) {
            legend.push_str("\nused: 99 of 100 answers took no longer.  allowed: by the link's source.");
        }
        legend.lines().map(|line| self.wrapped(line, 0)).collect()
    }

    /// Commands to try next.
    pub fn next(self) -> String {
        let mut text = String::from("Next:\n");
        let column = NEXT.iter().map(|(command, _)| command.len()).max().unwrap_or_default();
        let is_wide = NEXT.iter().all(|(_, about)| 2 + column + 4 + about.len() <= self.width);
        for (command, about) in NEXT {
            let _ = match is_wide {
                true => writeln!(text, "  {command:<column$}    {about}"),
                false => writeln!(text, "  {command}\n{}", self.wrapped(about, 6).trim_end()),
            };
        }
        text
    }
}

const NEXT: [(&str, &str); 3] = [
    ("cellwire demo kawasaki --faults", "the same over a connection that breaks"),
    ("cellwire demo laser --verbose", "every figure of one link"),
    ("cellwire simulate fanuc --listen 5020", "a robot for your own program"),
];

/// The result of a link's demo.
#[derive(Debug)]
pub struct DemoResult {
    /// The measurements of the run.
    pub report: Report,
    /// Whether a time above its budget is a failure.
    pub check_times: bool,
    /// The path of the picture; `None` without one.
    pub picture: Option<PathBuf>,
}

impl DemoResult {
    /// Returns whether all checks passed.
    pub fn is_good(&self) -> bool {
        self.report.is_good() && (self.report.is_in_time() || !self.check_times)
    }

    /// Returns the row, followed by the reason of a failure and the command that repeats it.
    pub fn row(&self, layout: Layout, again: &str) -> String {
        let (link, moves, done) = self.report.summary();
        let word = match (self.is_good(), self.report.is_in_time()) {
            (false, _) => "FAIL",
            (true, false) => "LATE",
            (true, true) => "ok",
        };
        let (count, lost, twice) = match done {
            ExecutedWork::Jobs(jobs, _) => {
                (jobs.executed_once, jobs.lost.to_string(), jobs.repeated.to_string())
            }
            ExecutedWork::Stream { done, lost, may_lose } => {
                let lost = if may_lose && lost > 0 { format!("({lost})") } else { lost.to_string() };
                (done, lost, "-".into())
            }
        };
        let deadline = match self.report.nearest() {
            Some((used, budget)) => {
                let (used, allowed) = (used.as_secs_f64() * 1e3, budget.time.as_secs_f64() * 1e3);
                let bar = "#".repeat(tenths(used, allowed));
                let bar = if layout.has_bar() { format!("{bar:.<10} ") } else { String::new() };
                format!("{bar}{used:4.1} {allowed:3.0} ms")
            }
            None => "none".into(),
        };
        let moves = if layout.has_moves() { format!("{moves:<23}") } else { String::new() };
        let mut row = format!("{word:<4} {link:<9} {moves}{count:>6} {lost:>5} {twice:>5}  {deadline}\n");
        if !self.is_good() {
            let late = self.report.over_budget().filter(|_| self.check_times);
            for failure in self.report.failures().iter().cloned().chain(late) {
                row.push_str(&layout.wrapped(&format!("{failure}."), INDENT));
            }
            // In one piece, to be copied.
            let _ = writeln!(row, "{:INDENT$}{again}", "");
        }
        row
    }

    /// Returns the row as an object with the same keys for every link.
    pub fn to_json(&self) -> Value {
        let (link, _, done) = self.report.summary();
        let jobs = if let ExecutedWork::Jobs(jobs, altered) = done { Some((jobs, altered)) } else { None };
        let count = |of: fn(&Counts) -> u64| jobs.map(|(jobs, _)| of(&jobs));
        let (done, lost) = match done {
            ExecutedWork::Jobs(jobs, _) => (jobs.executed_once, jobs.lost),
            ExecutedWork::Stream { done, lost, .. } => (done, lost),
        };
        let nearest = self.report.nearest();
        json!({
            "link": link, "ok": self.is_good(), "late": !self.report.is_in_time(), "sent": count(|it| it.sent),
            "done": done, "lost": lost, "repeated": count(|it| it.repeated),
            "withdrawn": count(|it| it.withdrawn), "altered": jobs.map(|(_, altered)| altered),
            "unknown": count(|it| it.unknown).unwrap_or(0), "unknown_executed": count(|it| it.unknown_executed),
            "used_us": nearest.map(|(used, _)| micros(used)),
            "allowed_us": nearest.map(|(_, budget)| micros(budget.time)),
            "source": nearest.map(|(_, budget)| budget.source), "picture": self.picture,
            "failures": self.report.failures(), "over_budget": self.report.over_budget().collect::<Vec<_>>(),
            "figures": self.report.to_json(),
        })
    }
}

/// Returns the used tenths of the allowed amount, rounded up; ten at most.
fn tenths(used: f64, allowed: f64) -> usize {
    (1..10).find(|tenth| used <= allowed * f64::from(*tenth) / 10.0).map_or(10, |tenth| tenth as usize)
}

/// Returns the sum of all rows: the jobs, and the deadlines.
pub fn verdict(layout: Layout, all: &[DemoResult]) -> String {
    let sentences = [jobs(all), deadlines(all)];
    sentences.iter().filter(|text| !text.is_empty()).map(|text| layout.wrapped(text, 0)).collect()
}

/// Returns the jobs of all rows; each job is in one of the counts.
fn jobs(all: &[DemoResult]) -> String {
    let (mut jobs, mut altered) = (Counts::default(), 0);
    for it in all {
        if let ExecutedWork::Jobs(counts, values) = it.report.summary().2 {
            (jobs, altered) = (jobs + counts, altered + values);
        }
    }
    let Counts {
        sent,
        executed_once: once,
        lost,
        repeated,
        unknown,
        unknown_executed,
        withdrawn,
        unreported,
    } = jobs;
    if sent == 0 {
        return String::new();
    }
    let sent = were(sent, "job");
    if once == jobs.sent && unknown == 0 {
        return format!("{sent} sent. Each was executed exactly once: 0 lost, 0 repeated.");
    }
    let mut text = format!("{sent} sent: {once} executed once, {lost} lost, {repeated} repeated");
    for (count, what) in [
        (withdrawn, "withdrawn before execution"),
        (altered, "executed with other values: corruption that the checksum cannot detect"),
        (unreported, "executed after the link had reported the opposite"),
        (unknown.saturating_sub(unknown_executed), "reported as unknown and not executed"),
    ] {
        if count > 0 {
            let _ = write!(text, ", {count} {what}");
        }
    }
    text.push('.');
    if unknown_executed > 0 {
        let _ = write!(
            text,
            " Of the executed jobs, {unknown_executed} {} reported as unknown.",
            was(unknown_executed)
        );
    }
    text
}

/// Returns the deadlines of all rows.
fn deadlines(all: &[DemoResult]) -> String {
    let with_deadline = all.iter().filter(|it| it.report.nearest().is_some()).count();
    let late: Vec<&str> =
        all.iter().filter(|it| !it.report.is_in_time()).map(|it| it.report.summary().0).collect();
    match (late.len(), with_deadline) {
        (_, 0) => String::new(),
        (0, 1) => "The deadline was kept.".into(),
        (0, 2) => "Both deadlines were kept.".into(),
        (0, count) => format!("All {count} deadlines were kept."),
        (missed, count) => {
            let checked = all.iter().any(|it| it.check_times);
            let more = if checked { "" } else { " On a quiet machine --check-times makes that a failure." };
            let verb = was(missed);
            format!("{missed} of {} {verb} missed: {}.{more}", counted(count, "deadline"), late.join(", "))
        }
    }
}

/// Returns the last sentence, if a check has failed.
pub fn failed(all: &[DemoResult]) -> Option<String> {
    let failed: Vec<&str> = all.iter().filter(|it| !it.is_good()).map(|it| it.report.summary().0).collect();
    match (failed.as_slice(), all.len()) {
        ([], _) => None,
        ([link], 1) => Some(format!("FAILED: the check of {link}.")),
        (_, count) => Some(format!("FAILED: {} of {count} links: {}.", failed.len(), failed.join(", "))),
    }
}

/// Returns the sentence about the location of the pictures.
pub fn pictures(layout: Layout, folder: Option<&Path>, all: &[DemoResult]) -> String {
    let Some(folder) = folder else {
        return "Pictures of what moved: cellwire demo --out FOLDER\n".into();
    };
    let names: Vec<String> = all
        .iter()
        .filter_map(|it| it.picture.as_ref())
        .filter_map(|it| Some(it.file_name()?.to_string_lossy().into_owned()))
        .collect();
    layout.wrapped(&format!("Pictures of what moved, in {}: {}", folder.display(), names.join(" ")), 0)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::io::samples::Samples;
    use crate::report::Budget;

    const WIDE: Layout = Layout { width: WIDTH };

    fn judged(link: &str, late: bool, jobs: Option<Counts>) -> DemoResult {
        let mut report = Report::new(link, "a title").moves("a pen draws a picture");
        match jobs {
            Some(jobs) => report.jobs(jobs, 0),
            None => report.stream(261, 6, true),
        }
        let mut samples = Samples::default();
        samples.add(Duration::from_micros(if late { 56_000 } else { 3_400 }));
        report.timing("t", "t", &samples, Some(Budget { time: Duration::from_millis(28), source: "§3.4" }));
        DemoResult { report, check_times: false, picture: None }
    }

    #[test]
    fn a_row_says_what_was_done_and_a_late_one_is_not_good_news() {
        let whole = Counts { sent: 7148, executed_once: 7148, ..Counts::default() };
        let good = judged("kawasaki", false, Some(whole));
        assert_eq!(
            good.row(WIDE, "again"),
            "ok   kawasaki  a pen draws a picture    7148     0     0  ##........  3.4  28 ms\n"
        );
        let late = judged("ball", true, None);
        assert_eq!(
            late.row(WIDE, "again"),
            "LATE ball      a pen draws a picture     261   (6)     -  ########## 56.0  28 ms\n"
        );
        let lossy =
            judged("laser", false, Some(Counts { sent: 2, executed_once: 1, lost: 1, ..Counts::default() }));
        assert!(
            lossy
                .row(WIDE, "cellwire demo laser --seed 1 --verbose")
                .ends_with("ms\n     1 job was lost.\n     cellwire demo laser --seed 1 --verbose\n")
        );
        let all = [good, late];
        let text = verdict(WIDE, &all);
        assert!(
            text.starts_with("7148 jobs were sent. Each was executed exactly once: 0 lost, 0 repeated.\n")
        );
        assert!(
            text.contains("1 of 2 deadlines was missed: ball.") && text.contains("--check-times"),
            "{text}"
        );
        let (head, legend) = (WIDE.head(), WIDE.legend(&all));
        assert!(
            [&head, &legend, &text].into_iter().flat_map(|it| it.lines()).all(|line| line.len() <= WIDTH)
        );
        assert!(legend.contains("(n): may be lost") && legend.contains("-: has no jobs."), "{legend}");
        let legend = WIDE.legend(&all[..1]);
        assert_eq!(legend.lines().next(), Some("done: executed, as the simulated robot counted."));
        assert!(!legend.contains("(n)") && !legend.contains("-: "), "{legend}");
        let strict = DemoResult { check_times: true, ..judged("ball", true, None) };
        assert!(!strict.is_good() && strict.row(WIDE, "again").starts_with("FAIL ball"));
    }

    #[test]
    fn no_line_is_longer_than_a_narrow_terminal() {
        let whole = Counts { sent: 7148, executed_once: 7140, lost: 8, ..Counts::default() };
        let all = [judged("kawasaki", true, Some(whole)), judged("ball", false, None)];
        for width in [40, 46, 56, 57, 60, 79] {
            let layout = Layout::new(Some(width));
            let rows = all.iter().map(|it| it.row(layout, "again")).collect::<String>();
            let parts = [layout.head(), rows, verdict(layout, &all), layout.legend(&all), layout.next()];
            for line in parts.iter().flat_map(|part| part.lines()) {
                assert!(line.chars().count() <= width.max(48), "{width}: {line}");
            }
        }
        let row = all[1].row(Layout::new(Some(60)), "again");
        assert_eq!(row, "ok   ball         261   (6)     -  ##........  3.4  28 ms\n");
        assert_eq!(
            Layout::new(Some(60)).head(),
            "     link        done  lost twice  deadline used, allowed\n"
        );
    }

    #[test]
    fn the_sums_add_up_and_the_last_sentence_names_the_failed_links() {
        let jobs = Counts {
            sent: 157,
            executed_once: 145,
            lost: 1,
            withdrawn: 2,
            unknown: 94,
            unknown_executed: 86,
            ..Counts::default()
        };
        let mut one = judged("laser", false, Some(jobs));
        one.report.jobs(jobs, 1);
        let sums = "157 jobs were sent: 145 executed once, 1 lost, 0 repeated, 2 withdrawn before execution, 1 executed with other values: \
            corruption that the checksum cannot detect, 8 reported as unknown and not executed. Of the executed jobs, 86 were reported as unknown.";
        let text = verdict(WIDE, &[one]);
        assert_eq!(text.lines().collect::<Vec<_>>().join(" "), format!("{sums} The deadline was kept."));
        let lossy = || judged("laser", false, Some(Counts { sent: 1, lost: 1, ..Counts::default() }));
        let good = || judged("ball", false, None);
        assert_eq!(failed(&[good()]), None);
        assert_eq!(failed(&[lossy()]).unwrap(), "FAILED: the check of laser.");
        assert_eq!(failed(&[lossy(), good()]).unwrap(), "FAILED: 1 of 2 links: laser.");
        let withdrawn = Counts { sent: 3, executed_once: 2, withdrawn: 1, ..Counts::default() };
        assert!(verdict(WIDE, &[judged("kawasaki", false, Some(withdrawn))]).contains("1 withdrawn"));
    }
}
