//! The harness of the `budgets` bench: instruction counts by callgrind and timing budgets, in tables with their goals; and
//! functions that it shares with `peers`.
//!
//! A count is exact and the same on a busy machine: the bench starts itself under callgrind for N and for 2N rounds and
//! divides the difference by N, so that start-up and preparation cancel out.

use std::process::{Command, ExitCode, Stdio};
use std::time::Duration;

use comfy_table::{CellAlignment, Table, presets::UTF8_FULL_CONDENSED};

/// The measurements of one link.
pub struct Link {
    /// The crate's name.
    pub name: &'static str,
    /// Instruction counts.
    pub counts: &'static [Count],
    /// Goals that follow from other rows.
    pub ratios: &'static [Ratio],
    /// Timing budgets, from the crate's `timing` functions.
    pub budgets: fn() -> Vec<Budget>,
}

/// One row of instruction counts.
pub struct Count {
    /// What is counted, as the table prints it.
    pub what: &'static str,
    /// The goal, in instructions for each unit; `None` for a peer or a row without a goal.
    pub goal: Option<f64>,
    /// The units that one round handles: 1 for "each operation", the bytes of the input for "each byte".
    pub units: f64,
    /// `"op"` or `"byte"`.
    pub unit: &'static str,
    /// Prepares, then does the work `rounds` times; all input and output passes `black_box`.
    pub run: fn(rounds: u64),
}

/// The goal of a row that is this many times the sum of other rows of its link, as they were counted in the same run; if the row has
/// a goal of its own, the greater of the two.
#[derive(Clone, Copy)]
pub struct Ratio {
    /// What the row counts.
    pub what: &'static str,
    /// How many times.
    pub times: f64,
    /// What the others count.
    pub of: &'static [&'static str],
}

/// One row of timing budgets.
pub struct Budget {
    /// What takes the time, and in which window.
    pub what: String,
    /// The time that it takes.
    pub takes: Duration,
    /// The time that the source allows.
    pub window: Duration,
    /// The section of the source.
    pub source: &'static str,
}

/// Prints the tables of all links whose name contains the first free argument. With `--check` a goal that is missed, or that was not
/// measured, is a failure.
pub fn main(links: &[Link]) -> ExitCode {
    let mut args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let check = args.iter().position(|a| a == "--check").map(|at| args.remove(at)).is_some();
    if let [flag, link, row, rounds] = args.as_slice()
        && flag == "--count"
    {
        let count =
            links.iter().find(|l| l.name == link).and_then(|l| l.counts.get(row.parse::<usize>().ok()?));
        let (Some(count), Ok(rounds)) = (count, rounds.parse()) else { panic!("no such row: {args:?}") };
        (count.run)(rounds);
        return ExitCode::SUCCESS;
    }
    let filter = args.first().map_or("", String::as_str);
    let chosen: Vec<&Link> = links.iter().filter(|l| l.name.contains(filter)).collect();
    if chosen.is_empty() {
        let names: Vec<_> = links.iter().map(|l| l.name).collect();
        eprintln!("no link is called {filter:?}; there are {}", names.join(", "));
        return ExitCode::from(2);
    }
    let valgrind =
        Command::new("valgrind").arg("--version").stdout(Stdio::null()).status().is_ok_and(|s| s.success());
    let mut missed = Vec::new();
    if valgrind {
        println!("{}", count_table(&chosen, &mut missed));
    } else {
        missed.push("nothing was counted".into());
        println!("No instruction counts: valgrind is not installed (Debian: apt-get install valgrind).");
    }
    println!("{}", budget_table(&chosen, &mut missed));
    if check && !missed.is_empty() {
        eprintln!("missed: {}", missed.join("; "));
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
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

fn count_table(links: &[&Link], missed: &mut Vec<String>) -> Table {
    let mut table = table(["link", "instructions", "for each", "measured", "goal", ""]);
    for link in links {
        let rows = link.counts.iter().enumerate();
        let rows: Vec<(&Count, f64)> =
            rows.map(|(row, count)| (count, measure(link.name, row) / count.units)).collect();
        for (count, measured) in &rows {
            let ratios = link.ratios.iter().filter(|ratio| ratio.what == count.what);
            let goal = ratios.map(|ratio| ratio.goal(&rows)).chain(count.goal).reduce(f64::max);
            let (goal, verdict) = match goal {
                Some(goal) if *measured > goal => {
                    missed.push(format!("{}: {}", link.name, count.what));
                    (number(goal), "MISSED")
                }
                Some(goal) => (number(goal), "met"),
                None => ("–".into(), ""),
            };
            table.add_row([link.name, count.what, count.unit, &number(*measured), &goal, verdict]);
        }
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

/// The instructions of one round: (Ir(2N) − Ir(N)) / N.
fn measure(link: &str, row: usize) -> f64 {
    const ROUNDS: u64 = 500;
    let (once, twice) = (collect(link, row, ROUNDS), collect(link, row, 2 * ROUNDS));
    (twice - once) as f64 / ROUNDS as f64
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

/// An empty table with this header.
pub fn table<const N: usize>(head: [&str; N]) -> Table {
    let mut table = Table::new();
    table.load_style(UTF8_FULL_CONDENSED).set_header(head);
    table
}

/// The median of the samples, which it sorts.
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
