//! The rows of the benches `budgets`, `calls` and `codecs`, and the harness of the first two: instruction counts by
//! callgrind and timing budgets, in tables with their goals.
//!
//! A count is exact and the same on a busy computer: the bench starts itself under callgrind for N and for 2N rounds and
//! divides the difference by N, so that start-up and preparation cancel out.

pub mod frames;
mod peer;
mod row;

use std::process::{Command, ExitCode, Stdio};
use std::time::Duration;

use comfy_table::{CellAlignment, Table, presets::UTF8_FULL_CONDENSED};
use serde::Serialize;

pub use peer::{Peer, Serve};
pub use row::{Count, Run, Timing};

/// The folder of the last counts, which `--write` writes and `reference write` reads: a file for each program.
const RESULTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/results");

/// The measurements of one link.
pub struct Link {
    /// The crate's name.
    pub name: &'static str,
    /// Instruction counts of its codec and its sessions.
    pub counts: &'static [Count],
    /// Goals that follow from other rows.
    pub ratios: &'static [Ratio],
    /// The rows of its decoders.
    pub streams: &'static [Stream],
    /// The other ends of its rows over TCP.
    pub peers: &'static [Serve],
    /// Timing budgets, from the crate's `timing` functions.
    pub budgets: fn() -> Vec<Budget>,
}

/// The rows of a decoder: valid frames in one piece and byte by byte, and noise.
pub type Stream = [Count; 5];

/// The goal of a row that is this many times the sum of other rows of its link, as they were counted in the same run; if the
/// row has a goal of its own, the greater of the two.
#[derive(Clone, Copy)]
pub struct Ratio {
    /// The work of the row, as its [`Count`] names it.
    pub what: &'static str,
    /// The factor.
    pub times: f64,
    /// The work of the other rows.
    pub of: &'static [&'static str],
}

/// One row of timing budgets.
pub struct Budget {
    /// The work that takes the time, and its window.
    pub what: String,
    /// The time that it takes.
    pub takes: Duration,
    /// The time that the source allows.
    pub window: Duration,
    /// The section of the source.
    pub source: &'static str,
}

/// A row as it was counted, in the table and in the file of results.
#[derive(Clone, Copy, Serialize)]
struct CountedRow {
    link: &'static str,
    what: &'static str,
    each: &'static str,
    measured: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    goal: Option<f64>,
}

impl Link {
    /// A link without rows.
    pub const EMPTY: Self =
        Self { name: "", counts: &[], ratios: &[], streams: &[], peers: &[], budgets: Vec::new };

    /// Returns all rows of instruction counts, in the sequence of the table.
    pub fn rows(&self) -> impl Iterator<Item = &'static Count> + use<> {
        self.counts.iter().chain(self.streams.iter().flatten())
    }

    fn count(&self) -> Vec<CountedRow> {
        let rows: Vec<(&Count, f64)> =
            self.rows().enumerate().map(|(row, count)| (count, measure(self.name, row, count))).collect();
        let counted = |(count, measured): &(&Count, f64)| {
            let goals =
                self.ratios.iter().filter(|ratio| ratio.what == count.what).map(|ratio| ratio.goal(&rows));
            CountedRow {
                link: self.name,
                what: count.what,
                each: count.each,
                measured: *measured,
                goal: goals.chain(count.goal).reduce(f64::max),
            }
        };
        rows.iter().map(counted).collect()
    }
}

impl Ratio {
    fn goal(&self, rows: &[(&Count, f64)]) -> f64 {
        let counted =
            |what: &&str| rows.iter().find(|(count, _)| count.what == *what).map(|(_, measured)| measured);
        let of =
            self.of.iter().map(|what| counted(what).unwrap_or_else(|| panic!("no row is called {what:?}")));
        self.times * of.sum::<f64>()
    }
}

/// Prints the tables of all links whose name contains the first free argument. With `--check` a goal that is missed, or that
/// was not measured, is a failure. With `--write` the counts are written to `benches/results/PROGRAM.json`; they must be
/// those of all links.
pub fn main(program: &str, links: &[Link]) -> ExitCode {
    let mut args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    if let [flag, link, row, rounds] = args.as_slice()
        && flag == "--count"
    {
        let link = links.iter().find(|l| l.name == link);
        let count = link.and_then(|link| link.rows().nth(row.parse().ok()?));
        let (Some(count), Ok(rounds)) = (count, rounds.parse()) else { panic!("no such row: {args:?}") };
        count.run.once(rounds);
        return ExitCode::SUCCESS;
    }
    if let [flag, link, number] = args.as_slice()
        && flag == "--peer"
    {
        let link = links.iter().find(|l| l.name == link);
        let Some(serve) = link.and_then(|link| link.peers.get(number.parse::<usize>().ok()?)) else {
            panic!("no such peer: {args:?}");
        };
        return if peer::run(*serve).is_ok() { ExitCode::SUCCESS } else { ExitCode::FAILURE };
    }
    let mut flag = |name| args.iter().position(|a| a == name).map(|at| args.remove(at)).is_some();
    let (check, write) = (flag("--check"), flag("--write"));
    let filter = args.first().map_or("", String::as_str);
    let chosen: Vec<&Link> = links.iter().filter(|l| l.name.contains(filter)).collect();
    if chosen.is_empty() {
        let names: Vec<_> = links.iter().map(|l| l.name).collect();
        eprintln!("no link is called {filter:?}; there are {}", names.join(", "));
        return ExitCode::from(2);
    }
    if write && chosen.len() < links.len() {
        eprintln!("--write needs the counts of all links: leave out {filter:?}");
        return ExitCode::from(2);
    }
    let valgrind =
        Command::new("valgrind").arg("--version").stdout(Stdio::null()).status().is_ok_and(|s| s.success());
    let mut missed = Vec::new();
    if valgrind {
        let rows: Vec<CountedRow> = chosen.iter().flat_map(|link| link.count()).collect();
        println!("{}", count_table(&rows, &mut missed));
        if write {
            std::fs::write(format!("{RESULTS}/{program}.json"), results(&rows))
                .expect("the file of results can be written");
        }
    } else {
        missed.push("nothing was counted".into());
        println!("No instruction counts: valgrind is not installed (Debian: apt-get install valgrind).");
    }
    let budgets = budget_table(&chosen, &mut missed);
    if !budgets.is_empty() {
        println!("{budgets}");
    }
    if (check && !missed.is_empty()) || (write && !valgrind) {
        eprintln!("missed: {}", missed.join("; "));
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}

/// Returns the file of results: one row per line, its numbers to a hundredth.
fn results(rows: &[CountedRow]) -> String {
    let hundredths = |x: f64| (x * 100.0).round() / 100.0;
    let line = |row: &CountedRow| {
        let (measured, goal) = (hundredths(row.measured), row.goal.map(hundredths));
        serde_json::to_string(&CountedRow { measured, goal, ..*row }).expect("plain values")
    };
    format!("[\n{}\n]\n", rows.iter().map(line).collect::<Vec<_>>().join(",\n"))
}

fn count_table(rows: &[CountedRow], missed: &mut Vec<String>) -> Table {
    let mut table = table(["link", "instructions", "for each", "measured", "goal", ""]);
    for CountedRow { link, what, each, measured, goal } in rows {
        let (goal, verdict) = match goal {
            Some(goal) if measured > goal => {
                missed.push(format!("{link}: {what}"));
                (number(*goal), "MISSED")
            }
            Some(goal) => (number(*goal), "met"),
            None => ("–".into(), ""),
        };
        table.add_row([link, what, each, &*number(*measured), &goal, verdict]);
    }
    right_align(&mut table, &[3, 4]);
    table
}

fn budget_table(links: &[&Link], missed: &mut Vec<String>) -> Table {
    let mut table = table(["link", "timing budget", "takes", "window", "margin", "source"]);
    for link in links {
        for budget in (link.budgets)() {
            let margin = budget.window.as_secs_f64() - budget.takes.as_secs_f64();
            if margin < 0.0 {
                missed.push(format!("{}: {}", link.name, budget.what));
            }
            table.add_row([
                link.name.into(),
                budget.what,
                milliseconds(budget.takes.as_secs_f64()),
                milliseconds(budget.window.as_secs_f64()),
                milliseconds(margin),
                budget.source.into(),
            ]);
        }
    }
    right_align(&mut table, &[2, 3, 4]);
    table
}

/// Measures the instructions of one unit of a row: (Ir(2N) − Ir(N)) / N, by the units of a round.
fn measure(link: &str, row: usize, count: &Count) -> f64 {
    let (once, twice) = (collect(link, row, count.rounds), collect(link, row, 2 * count.rounds));
    (twice - once) as f64 / count.rounds as f64 / count.units
}

fn collect(link: &str, row: usize, rounds: u64) -> i64 {
    let this = std::env::current_exe().expect("the path of this program");
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(this)
        .args(["--count", link, &row.to_string(), &rounds.to_string()])
        .output()
        .expect("valgrind runs");
    let log = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "row {row} of {link} failed under callgrind:\n{log}");
    let collected = log
        .lines()
        .find_map(|line| line.split_once("Collected : "))
        .expect("callgrind prints what it collected");
    collected.1.trim().parse().expect("a number of instructions")
}

/// Creates an empty table with this header.
pub fn table<const N: usize>(head: [&str; N]) -> Table {
    let mut table = Table::new();
    table.load_style(UTF8_FULL_CONDENSED).set_header(head);
    table
}

/// Returns the median of the samples, which it sorts.
pub fn median(samples: &mut [f64]) -> Option<f64> {
    samples.sort_by(f64::total_cmp);
    samples.get(samples.len() / 2).copied()
}

fn right_align(table: &mut Table, columns: &[usize]) {
    for &index in columns {
        if let Some(column) = table.column_mut(index) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
}

fn number(x: f64) -> String {
    if x < 20.0 { format!("{x:.2}") } else { format!("{x:.0}") }
}

fn milliseconds(seconds: f64) -> String {
    format!("{:.3} ms", seconds * 1e3)
}
