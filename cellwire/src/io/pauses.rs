//! When the host was stalled: a late thread cannot tell its own fault from a processor that was busy, or that the
//! host of a virtual machine had taken away.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use cellwire_io::clock::Clock;

/// How long each thread sleeps.
const TICK: Duration = Duration::from_millis(1);
/// How much later it is woken on a machine that has nothing else to do, and more.
const PAUSE: Duration = Duration::from_millis(2);
/// How many pauses of a processor are kept; what comes after them is no excuse for anything.
const KEPT: usize = 100_000;

/// A thread on each processor that sleeps and sees when it is woken too late. They have the normal priority, as has what moves the
/// bytes of a pseudo-terminal.
#[derive(Debug)]
pub struct Watch {
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<Vec<Pause>>>,
}

/// A thread was to be woken at `from`, and was at `to`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Pause {
    from: Duration,
    to: Duration,
}

/// When the processors were stalled, while they were watched.
#[derive(Debug, Clone, Default)]
pub struct Pauses(Vec<Pause>);

impl Watch {
    /// Begins, by this clock. Without a thread to spare nothing is seen.
    pub fn start(clock: Clock) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let processors = thread::available_parallelism().map_or(1, usize::from);
        let watch = |processor| {
            let stop = stop.clone();
            thread::Builder::new().spawn(move || observe(processor, clock, &stop)).ok()
        };
        let threads = (0..processors).filter_map(watch).collect();
        Self { stop, threads }
    }

    /// Ends.
    pub fn stop(self) -> Pauses {
        self.stop.store(true, Ordering::Relaxed);
        Pauses(self.threads.into_iter().filter_map(|thread| thread.join().ok()).flatten().collect())
    }
}

fn observe(processor: usize, clock: Clock, stop: &AtomicBool) -> Vec<Pause> {
    stay_on(processor);
    let mut pauses = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        let from = clock.now() + TICK;
        thread::sleep(TICK);
        let to = clock.now();
        if to.saturating_sub(from) >= PAUSE && pauses.len() < KEPT {
            pauses.push(Pause { from, to });
        }
    }
    pauses
}

/// Keeps the current thread on the processor with this number, where the system has such an order and such a processor.
fn stay_on(processor: usize) {
    #[cfg(target_os = "linux")]
    {
        let mut only = rustix::thread::CpuSet::new();
        only.set(processor);
        let _ = rustix::thread::sched_setaffinity(None, &only);
    }
    #[cfg(not(target_os = "linux"))]
    let _ = processor;
}

impl Pauses {
    /// Stalls of processors, each from the first to the second time.
    pub fn of(pauses: &[(Duration, Duration)]) -> Self {
        Self(pauses.iter().map(|&(from, to)| Pause { from, to }).collect())
    }

    /// The total stall of all processors between two times.
    pub fn between(&self, from: Duration, to: Duration) -> Duration {
        self.0.iter().map(|pause| pause.to.min(to).saturating_sub(pause.from.max(from))).sum()
    }

    /// For how long in all.
    pub fn total(&self) -> Duration {
        self.between(Duration::ZERO, Duration::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn a_pause_counts_as_far_as_it_lies_in_the_time() {
        let pauses = Pauses::of(&[(10 * MS, 20 * MS), (15 * MS, 18 * MS)]);
        assert_eq!(pauses.total(), 13 * MS);
        assert_eq!(pauses.between(Duration::ZERO, 10 * MS), Duration::ZERO);
        assert_eq!(pauses.between(12 * MS, 16 * MS), 5 * MS);
        assert_eq!(pauses.between(19 * MS, 40 * MS), MS);
    }

    #[test]
    fn a_watch_sees_its_time() {
        let clock = Clock::start();
        let watch = Watch::start(clock);
        thread::sleep(20 * MS);
        let pauses = watch.stop();
        assert_eq!(pauses.between(clock.now(), Duration::MAX), Duration::ZERO);
    }
}
