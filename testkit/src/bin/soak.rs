//! `soak --seeds N`: both ends of every session over bad transports, and a table of the outcome of every job.

use core::ops::Range;
use std::collections::BTreeMap;
use std::panic;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use clap::Parser;
use comfy_table::{CellAlignment, Table, presets};
use indicatif::{ProgressBar, ProgressStyle};
use testkit::soak::{HANDLES, Log, ROWS, Row, Tally};

/// Runs both ends of every session over the faults that its transport can commit, on a virtual clock, from seeds.
///
/// The same seed makes the same session on every machine. Exit 1 if a job was lost or executed twice without a report, if a
/// session was stuck, or if more corruption went unseen than the protocol's own check can be blamed for.
#[derive(Debug, Parser)]
struct Args {
    /// Sessions of each link and transport.
    #[arg(long, default_value_t = 1000)]
    seeds: u64,
    /// The first seed.
    #[arg(long, default_value_t = 0)]
    first: u64,
    /// One session alone, instead of --seeds and --first.
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
    /// Only these: a link, or a link and its transport as `kawasaki-msg/udp`.
    #[arg(long = "link", value_name = "LINK", value_parser = known)]
    links: Vec<String>,
    /// Prints what each end receives, sends and reports. Only with --seed.
    #[arg(long, requires = "seed")]
    trace: bool,
    /// Threads; all cores by default.
    #[arg(long)]
    jobs: Option<usize>,
}

fn all_rows() -> impl Iterator<Item = &'static Row> {
    ROWS.iter().chain(&HANDLES)
}

fn known(name: &str) -> Result<String, String> {
    if all_rows().any(|row| row.is_named(name)) {
        return Ok(name.into());
    }
    let names: Vec<_> = all_rows().map(Row::name).collect();
    Err(format!("known are {}", names.join(", ")))
}

fn main() -> ExitCode {
    let args = Args::parse();
    let wanted = |row: &&Row| args.links.is_empty() || args.links.iter().any(|name| row.is_named(name));
    let rows: Vec<Row> = all_rows().filter(wanted).copied().collect();
    let (first, seeds) = args.seed.map_or((args.first, args.seeds), |seed| (seed, 1));
    if args.trace {
        for row in &rows {
            println!("--- {}, seed {first}", row.name());
            row.run(first, Log::ON);
        }
    }
    if !args.trace {
        // A session that panics is counted, and its message seen when it is traced.
        panic::set_hook(Box::new(|_| {}));
    }
    let begin = Instant::now();
    let jobs = args.jobs.unwrap_or_else(|| thread::available_parallelism().map_or(1, usize::from)).max(1);
    let (tallies, failures) = run(&rows, first, seeds, jobs);
    let time = begin.elapsed();

    println!("{}\n{LEGEND}\n", table(&rows, &tallies));
    let sessions: u64 = tallies.iter().map(|tally| tally.sessions).sum();
    let rate = sessions as f64 / time.as_secs_f64();
    println!("{sessions} sessions in {:.1} s, {rate:.0} a second on {jobs} threads", time.as_secs_f64());
    let blind = rows.iter().zip(&tallies).filter(|(row, tally)| row.sees_too_little(tally));
    let blind: Vec<_> = blind.map(|(row, _)| row.name()).collect();
    for (name, seed) in failures.values().flatten().take(10) {
        println!("failed check, reproduce with: cargo xtask soak --link '{name}' --seed {seed} --trace");
    }
    for name in &blind {
        println!("failed check: {name} misses more corruption than its checksum explains");
    }
    let good = failures.is_empty() && blind.is_empty() && sessions > 0;
    println!("{}", if good { "nothing lost, nothing repeated, nothing stuck" } else { "FAILED" });
    ExitCode::from(u8::from(!good))
}

/// The sums of each row, and the seeds that broke a promise.
type Results = (Vec<Tally>, BTreeMap<usize, Vec<(String, u64)>>);

fn run(rows: &[Row], first: u64, seeds: u64, jobs: usize) -> Results {
    let results: Mutex<Results> = Mutex::new((vec![Tally::default(); rows.len()], BTreeMap::new()));
    let (work, done) = (AtomicU64::new(0), AtomicU64::new(0));
    let bar = ProgressBar::new(seeds * rows.len() as u64).with_style(
        ProgressStyle::with_template("{wide_bar} {pos}/{len} sessions, {per_sec}, {eta} left").unwrap(),
    );
    let thread = || {
        while let Some((index, seeds)) = batch(work.fetch_add(1, Ordering::Relaxed), rows, seeds) {
            let (row, count) = (&rows[index], seeds.end - seeds.start);
            let (mut sum, mut bad) = (Tally::default(), Vec::new());
            for seed in seeds.start + first..seeds.end + first {
                let tally = row.run(seed, Log::OFF);
                if tally.is_bad() {
                    bad.push((row.name(), seed));
                }
                sum += tally;
            }
            done.fetch_add(count, Ordering::Relaxed);
            let mut results = results.lock().unwrap();
            results.0[index] += sum;
            if !bad.is_empty() {
                results.1.entry(index).or_default().extend(bad);
            }
        }
    };
    thread::scope(|scope| {
        let threads: Vec<_> = (0..jobs).map(|_| scope.spawn(thread)).collect();
        while !threads.iter().all(|thread| thread.is_finished()) {
            bar.set_position(done.load(Ordering::Relaxed));
            thread::sleep(Duration::from_millis(50));
        }
    });
    bar.finish_and_clear();
    results.into_inner().unwrap()
}

/// Returns the `n`-th piece of the work: a row, and some of its seeds. The rows take turns, so that a run that ends early
/// has covered all of them.
fn batch(n: u64, rows: &[Row], seeds: u64) -> Option<(usize, Range<u64>)> {
    const SIZE: u64 = 64;
    let begin = n / rows.len() as u64 * SIZE;
    (begin < seeds).then(|| ((n % rows.len() as u64) as usize, begin..seeds.min(begin + SIZE)))
}

/// The columns, in order: the run, the faults of the transport, the outcomes of the jobs, and the undetected corruption.
const HEADER: [&str; 24] = [
    "",
    "sessions",
    "flips",
    "bytes lost",
    "inserted",
    "silences",
    "repeats",
    "splits",
    "stalls",
    "merges",
    "delays",
    "breaks",
    "jobs",
    "once",
    "not done",
    "unknown",
    "LOST",
    "REPEATED",
    "INVENTED",
    "STUCK",
    "corrupt",
    "unseen",
    "theory",
    "forged",
];

const LEGEND: &str = "\
any X     X is not ours: it chooses among what the source's rules permit. hostile X: it sends anything
jobs      each is in one of: once (reported done, executed once), not done (reported so, and true), unknown (reported so,
          executed at most once), LOST and REPEATED (not reported), forged. INVENTED: executed, though nobody sent it. STUCK:
          sessions that did not do all the work that they were asked for without faults at the end.
corrupt   transmissions whose bytes the line has changed; silences, repeats and breaks are counted by themselves
unseen    valid messages by the protocol's own check that corruption has made, shown by the bytes that arrived; theory: how many
          of the messages with corrupt bytes would pass if they were random; forged: jobs that one of them explains";

fn table(rows: &[Row], tallies: &[Tally]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(HEADER.map(|name| name.replace(' ', "\n")));
    for (row, tally) in rows.iter().zip(tallies) {
        let mut cells = vec![format!("{} {}: {}", row.link, row.transport, row.job), short(tally.sessions)];
        cells.extend(tally.faults.each().map(|(_, count)| short(count)));
        cells.extend([tally.jobs, tally.once, tally.not_done, tally.unknown].map(short));
        cells
            .extend([tally.lost, tally.repeated, tally.invented, tally.stuck].map(|count| count.to_string()));
        cells.push(short(tally.corrupt));
        cells.push(tally.unseen.to_string());
        cells.push(row.one_in.map_or("–".into(), |_| format!("{:.0}", row.expected_unseen(tally))));
        cells.push(tally.forged.to_string());
        table.add_row(cells);
    }
    for (n, column) in table.column_iter_mut().enumerate() {
        column.set_padding((0, 1));
        column.set_cell_alignment(if n == 0 { CellAlignment::Left } else { CellAlignment::Right });
    }
    table
}

/// Formats a count with three digits and a unit; zero is a point, so that other counts stand out.
fn short(count: u64) -> String {
    let (value, unit) = match count {
        0 => return "·".into(),
        1..10_000 => return count.to_string(),
        10_000..1_000_000 => (count as f64 / 1e3, "k"),
        _ => (count as f64 / 1e6, "M"),
    };
    let digits = if value < 10.0 { 2 } else { usize::from(value < 100.0) };
    format!("{value:.digits$}{unit}")
}
