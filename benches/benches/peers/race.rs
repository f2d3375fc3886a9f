//! A race on one processor: contenders take turns, their order rotates every round, and the medians are compared.

use std::time::{Duration, Instant};

use benches::{median, table};

const ROUNDS: usize = 51;
/// The shortest duration of a sample: its preparation takes a negligible time in comparison.
const SAMPLE: Duration = Duration::from_millis(1);

/// A name, and a function that does the work a number of times.
pub(crate) type Contender = (&'static str, fn(u64));

/// Prints the time of each contender, and its ratio to that of the first one.
pub(crate) fn race<const N: usize>(work: &str, contenders: [Contender; N]) {
    if let Some(&first) = core_affinity::get_core_ids().unwrap_or_default().first() {
        core_affinity::set_for_current(first);
    }
    let repeats = contenders.map(|(_, run)| repeats(run));
    let mut samples = [const { Vec::new() }; N];
    for round in 0..ROUNDS {
        for turn in 0..N {
            let at = (round + turn) % N;
            let ((_, run), repeats) = (contenders[at], repeats[at]);
            samples[at].push(time(run, repeats).as_nanos() as f64 / repeats as f64);
        }
    }
    let medians = samples.map(|mut samples| median(&mut samples).unwrap_or(f64::NAN));
    let mut table = table([work, "time", "relative"]);
    for ((name, _), time) in contenders.iter().zip(medians) {
        table.add_row([(*name).to_owned(), format!("{time:.1} ns"), format!("{:.2} ×", time / medians[0])]);
    }
    println!("{table}");
}

/// Returns the number of repetitions of the work in a sample. The shortest of five times counts, because one may have been
/// interrupted.
fn repeats(run: fn(u64)) -> u64 {
    let mut repeats = 1;
    while (0..5).any(|_| time(run, repeats) < SAMPLE) {
        repeats *= 2;
    }
    repeats
}

fn time(run: fn(u64), repeats: u64) -> Duration {
    let start = Instant::now();
    run(repeats);
    start.elapsed()
}
