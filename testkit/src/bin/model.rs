//! `model`: every state of every pair of ends, the rules that are needed, and the diagrams.

use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use clap::{Args, Parser, Subcommand};
use comfy_table::{CellAlignment, Table, presets};
use indicatif::{ProgressBar, ProgressStyle};
use testkit::links::{MARGINS, PAIRS};
use testkit::model::{
    BrokenProperty, Depth, ExplorationResult, Margin, MarginResult, MustFail, Options, Pair, Setting,
    check_or_write,
};
use testkit::soak::Log;

/// Explores every end with any peer exhaustively: the machine, the line between them with every fault that it can commit,
/// and what their users may do.
///
/// Prints a row for each setting. Exit 1 if a property does not hold, with the shortest trace to where it does not, or if a
/// setting has more states than were visited.
#[derive(Debug, Parser)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    /// Bounds of up to five minutes a pair instead of seconds.
    #[arg(long)]
    deep: bool,
    /// Counts states and steps with the model checker stateright, too. Exit 1 if they differ.
    #[cfg(feature = "stateright")]
    #[arg(long)]
    stateright: bool,
    #[command(flatten)]
    common: Common,
}

#[derive(Debug, Args)]
struct Common {
    /// Only the pairs whose name contains this, as `laser` or `tcp`.
    #[arg(long = "link", value_name = "NAME", value_parser = known, global = true)]
    links: Vec<String>,
    /// Threads; all cores by default.
    #[arg(long, global = true)]
    jobs: Option<usize>,
    /// The most states of a setting. Each takes some 100 bytes.
    #[arg(long, global = true, default_value_t = Options::default().limit)]
    limit: usize,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Takes the rules of every machine out, one after the other: each must be missed.
    ///
    /// Prints for each rule the property that then breaks, and the length of the shortest trace to it. Exit 1 if the removal of
    /// a rule is not noticed.
    MustFail {
        /// Prints the traces, too.
        #[arg(long)]
        traces: bool,
        /// Also walks each session without its rule from this many seeds, and prints the share that notices.
        #[arg(long, default_value_t = 0)]
        seeds: u64,
    },
    /// Prints, as Markdown, what is known of the peers that have no machine, and what holds all the same.
    Peers,
    /// Makes what each end assumes about time less and less true, until a property breaks.
    ///
    /// Prints the last step in which everything holds, and the first in which something breaks. Exit 1 if something breaks where
    /// the assumption is true.
    Margins,
    /// Draws the state diagram of every end and writes it to `<crate>/diagrams/<end>.md`.
    Diagrams {
        /// Writes nothing; exit 1 if a file is not what would be written.
        #[arg(long)]
        check: bool,
    },
}

fn known(name: &str) -> Result<String, String> {
    if PAIRS.iter().any(|pair| pair.name.contains(name)) {
        return Ok(name.into());
    }
    let names: Vec<_> = PAIRS.iter().map(|pair| pair.name).collect();
    Err(format!("known are {}", names.join(", ")))
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let (common, depth) = (cli.common, if cli.deep { Depth::Deep } else { Depth::Quick });
    let selected =
        |pair: &&Pair| common.links.is_empty() || common.links.iter().any(|name| pair.name.contains(name));
    let pairs: Vec<Pair> = PAIRS.iter().filter(selected).copied().collect();
    let good = match cli.command {
        #[cfg(feature = "stateright")]
        None if cli.stateright => cross_check(&pairs, depth, &common),
        None => explore(&pairs, depth, &common),
        Some(Command::MustFail { traces, seeds }) => must_fail(&pairs, traces, seeds, &common),
        Some(Command::Peers) => peers(&pairs, depth, &common),
        Some(Command::Margins) => margins(&common),
        Some(Command::Diagrams { check }) => diagrams(&pairs, !check),
    };
    ExitCode::from(u8::from(!good))
}

fn explore(pairs: &[Pair], depth: Depth, common: &Common) -> bool {
    let settings = settings(pairs, depth);
    let begin = Instant::now();
    let rows = run(&settings, common, |(_, setting), options| setting.explore(options));
    let time = begin.elapsed();

    let mut table =
        table(&["pair", "setting", "states", "steps", "seconds", "work ends\n(ticks)", "properties"], 2..6);
    for ((pair, _), row) in settings.iter().zip(&rows) {
        table.add_row([
            (*pair).into(),
            row.setting.clone(),
            thousands(row.states),
            thousands(row.steps),
            format!("{:.1}", row.time.as_secs_f64()),
            row.longest_benign.to_string(),
            verdict(row),
        ]);
    }
    println!("{table}\n");
    for ((pair, _), row) in settings.iter().zip(&rows) {
        for BrokenProperty { property, steps, trace } in &row.broken {
            println!("{pair}, {}: broken after {steps} steps: {property}\n    {trace}\n", row.setting);
        }
        if !row.complete {
            println!("{pair}, {}: there are more states than were visited, see --limit\n", row.setting);
        }
    }
    let states = thousands(rows.iter().map(|row| row.states).sum());
    let good = rows.iter().all(ExplorationResult::holds) && !rows.is_empty();
    println!("{states} states of {} settings in {:.1} s", rows.len(), time.as_secs_f64());
    println!("{}", if good { "every property holds in every state" } else { "FAILED" });
    good
}

fn settings(pairs: &[Pair], depth: Depth) -> Vec<(&'static str, Setting)> {
    let settings = |pair: &Pair| {
        (pair.settings)(depth).into_iter().map(|setting| (pair.name, setting)).collect::<Vec<_>>()
    };
    pairs.iter().flat_map(settings).collect()
}

#[cfg(feature = "stateright")]
fn cross_check(pairs: &[Pair], depth: Depth, common: &Common) -> bool {
    let settings = settings(pairs, depth);
    let rows = run(&settings, common, |(_, setting), options| (setting.explore(options), setting.count()));
    let mut table = table(&["pair", "setting", "states", "stateright's", "steps", "stateright's"], 2..6);
    let mut good = !rows.is_empty();
    for ((pair, setting), (row, (states, steps))) in settings.iter().zip(&rows) {
        let counts = [row.states, *states, row.steps, *steps].map(thousands);
        table.add_row([(*pair).into(), setting.name.clone()].into_iter().chain(counts));
        good &= row.complete && (row.states, row.steps) == (*states, *steps);
    }
    println!("{table}\n");
    println!("{}", if good { "both count the same" } else { "FAILED: the counts differ" });
    good
}

fn verdict(row: &ExplorationResult) -> String {
    match (row.broken.len(), row.complete) {
        (0, true) => "hold".into(),
        (0, false) => "NOT ALL STATES".into(),
        (count, _) => format!("{count} BROKEN"),
    }
}

fn must_fail(pairs: &[Pair], traces: bool, seeds: u64, common: &Common) -> bool {
    let work = |pair: &Pair| (pair.must_fail)().into_iter().map(|case| (pair.name, case)).collect::<Vec<_>>();
    let cases: Vec<(&str, MustFail)> = pairs.iter().flat_map(work).collect();
    let rows = run(&cases, common, |(_, case), options| case.caught(options));
    let shares = run(&cases, common, |(_, case), _| noticed(case, seeds));

    let mut table = table(&["pair", "without", "in", "steps", "seeds", "breaks"], 3..5);
    for (((pair, case), caught), share) in cases.iter().zip(&rows).zip(shares) {
        let (steps, breaks) = match caught {
            Some(broken) => (broken.steps.to_string(), broken.property.into()),
            None => (String::new(), format!("NOTHING; expected: {}", case.property)),
        };
        table.add_row([(*pair).into(), case.rule.into(), case.without.name.clone(), steps, share, breaks]);
    }
    println!("{table}\n");
    if traces {
        for ((pair, case), broken) in
            cases.iter().zip(&rows).filter_map(|(case, row)| Some((case, row.as_ref()?)))
        {
            println!("{pair} without {}: {}\n    {}\n", case.rule, broken.property, broken.trace);
        }
    }
    let missed = rows.iter().filter(|row| row.is_none()).count();
    println!("{} rules, assumptions and bounds taken out, {missed} not detected", rows.len());
    let good = missed == 0 && !rows.is_empty();
    println!("{}", if good { "each is needed" } else { "FAILED" });
    good
}

/// Returns the share of seeds whose random walk detects a missing rule.
fn noticed(case: &MustFail, seeds: u64) -> String {
    let walk = |seed| case.without.walk(seed, Log::OFF).map(|tally| u32::from(tally.is_bad()));
    let noticed = (0..seeds).map(walk).sum::<Option<u32>>().filter(|_| seeds > 0);
    noticed.map(|count| format!("{:.1} %", f64::from(count) * 100.0 / seeds as f64)).unwrap_or_default()
}

fn peers(pairs: &[Pair], depth: Depth, common: &Common) -> bool {
    let settings: Vec<_> = settings(pairs, depth)
        .into_iter()
        .filter_map(|(pair, setting)| Some((pair, setting.terms?, setting)))
        .collect();
    let rows = run(&settings, common, |(_, _, setting), options| setting.explore(options));
    println!("| end and peer | clauses that it keeps | what is open | what holds | states | seconds |");
    println!("| --- | --- | --- | --- | ---: | ---: |");
    for ((pair, terms, setting), row) in settings.iter().zip(&rows) {
        let keeps = if terms.keeps.is_empty() { "none" } else { terms.keeps };
        let (free, holds) = (terms.free, terms.properties.join("; "));
        let (states, seconds) = (thousands(row.states), row.time.as_secs_f64());
        let verdict = if row.holds() { "" } else { " **FAILED**" };
        println!(
            "| {pair}, {} | {keeps} | {free} | {holds}{verdict} | {states} | {seconds:.1} |",
            setting.name
        );
    }
    rows.iter().all(ExplorationResult::holds) && !rows.is_empty()
}

fn margins(common: &Common) -> bool {
    let is_selected =
        |end: &str| common.links.is_empty() || common.links.iter().any(|name| end.contains(name));
    let margins: Vec<Margin> =
        MARGINS.iter().flat_map(|each| each()).filter(|margin| is_selected(margin.end)).collect();
    let rows = run(&margins, common, |margin, options| margin.measure(options));
    let header = [
        "end",
        "setting",
        "real",
        "holds\n(assumed, real)",
        "margin\n(ms)",
        "breaks\n(assumed, real)",
        "what",
    ];
    let mut table = table(&header, 3..6);
    for (margin, row) in margins.iter().zip(&rows) {
        let MarginResult { holds, breaks } = row;
        let pair = |assumed: &Duration, real: &Duration| format!("{assumed:?}, {real:?}");
        table.add_row([
            margin.end.into(),
            margin.setting.into(),
            margin.real.into(),
            holds.map(|(assumed, real)| pair(&assumed, &real)).unwrap_or_default(),
            row.margin().map(|ms| format!("{ms:+.1}")).unwrap_or_default(),
            breaks.as_ref().map(|(assumed, real, _)| pair(assumed, real)).unwrap_or_default(),
            breaks.as_ref().map_or("nothing", |(.., property)| property).into(),
        ]);
    }
    println!("{table}\n");
    let good = rows.iter().all(MarginResult::is_kept) && !rows.is_empty();
    println!("{}", if good { "what is assumed is enough" } else { "FAILED" });
    good
}

fn diagrams(pairs: &[Pair], write: bool) -> bool {
    let mut good = true;
    for diagram in pairs.iter().flat_map(|pair| (pair.diagrams)()) {
        match check_or_write(&diagram.path, &diagram.text, write) {
            Ok(()) => println!("{}", diagram.path.display()),
            Err(error) => {
                println!("{error}");
                good = false;
            }
        }
    }
    good
}

/// Does `work` for every item, on all cores, the first ones first; shows the progress.
fn run<T: Sync, R: Send>(
    items: &[T],
    common: &Common,
    work: impl Fn(&T, &Options<'_>) -> R + Sync,
) -> Vec<R> {
    let jobs = common.jobs.unwrap_or_else(|| thread::available_parallelism().map_or(1, usize::from)).max(1);
    let (next, done, states) = (AtomicUsize::new(0), AtomicU64::new(0), AtomicU64::new(0));
    let results: Mutex<Vec<Option<R>>> = Mutex::new(items.iter().map(|_| None).collect());
    let bar = ProgressBar::new(items.len() as u64)
        .with_style(ProgressStyle::with_template("{wide_bar} {pos}/{len}, {msg} states, {elapsed}").unwrap());
    let options = Options { limit: common.limit, progress: Some(&states), ..Options::default() };
    let thread = || {
        while let Some((at, item)) =
            Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|at| Some((at, items.get(at)?)))
        {
            let result = work(item, &options);
            results.lock().unwrap()[at] = Some(result);
            done.fetch_add(1, Ordering::Relaxed);
        }
    };
    thread::scope(|scope| {
        let threads: Vec<_> = (0..jobs).map(|_| scope.spawn(thread)).collect();
        while !threads.iter().all(|thread| thread.is_finished()) {
            bar.set_position(done.load(Ordering::Relaxed));
            bar.set_message(thousands(states.load(Ordering::Relaxed) as usize));
            thread::sleep(Duration::from_millis(50));
        }
    });
    bar.finish_and_clear();
    results.into_inner().unwrap().into_iter().map(|result| result.expect("every item has a result")).collect()
}

fn table(header: &[&str], numbers: core::ops::Range<usize>) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(header);
    for (n, column) in table.column_iter_mut().enumerate() {
        column.set_padding((0, 2));
        column.set_cell_alignment(if numbers.contains(&n) {
            CellAlignment::Right
        } else {
            CellAlignment::Left
        });
    }
    table
}

/// Formats a count as `1 234 567`
fn thousands(count: usize) -> String {
    let digits = count.to_string();
    let groups = digits.as_bytes().rchunks(3).rev().map(|group| String::from_utf8_lossy(group).into_owned());
    groups.collect::<Vec<_>>().join(" ")
}
