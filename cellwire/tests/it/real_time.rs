//! Tests of what keeps real time, on computers that do not always: an arm has 15 ms for a reply, and a processor may be
//! taken away for longer.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// The sleep of a watching thread, and the delay of its end that counts as a stall.
const TICK: Duration = Duration::from_millis(1);
const STALL: Duration = Duration::from_millis(2);
/// A third of the window: shorter stalls explain no failure.
const PAUSE: Duration = Duration::from_millis(5);
/// A computer whose processors stall for this fraction of the time cannot keep a cycle of 28 ms.
const UNFIT: u32 = 50;

/// Runs a test. If it fails and the computer was stalled meanwhile, it begins again; if the computer is unfit each time, the
/// test is not judged, and prints that.
pub(crate) fn in_real_time(test: impl Fn() + Sync) {
    let mut unfit = true;
    for attempt in 1.. {
        let begin = Instant::now();
        let ends = AtomicBool::new(false);
        let processors = thread::available_parallelism().map_or(1, usize::from);
        let (result, paused) = thread::scope(|scope| {
            let watch = |processor| {
                scope.spawn({
                    let ends = &ends;
                    move || stalled(processor, ends)
                })
            };
            let watches: Vec<_> = (0..processors).map(watch).collect();
            // Of its own: a test may raise its thread's priority, which the watches must not have.
            let result = scope.spawn(&test).join();
            ends.store(true, Ordering::Relaxed);
            let paused: Duration = watches.into_iter().filter_map(|watch| watch.join().ok()).sum();
            (result, paused)
        });
        let time = begin.elapsed();
        let Err(panic) = result else { return };
        unfit &= paused > time / UNFIT;
        if paused < PAUSE || (attempt == 3 && !unfit) {
            resume_unwind(panic);
        }
        eprintln!("attempt {attempt}: the host was stalled for {paused:?} of {time:?}");
        if attempt == 3 {
            eprintln!("NOT JUDGED: this machine keeps no real time");
            return;
        }
    }
}

/// Sleeps on this processor until the test ends; returns how long it was woken too late, in all.
fn stalled(processor: usize, ends: &AtomicBool) -> Duration {
    #[cfg(target_os = "linux")]
    {
        let mut only = rustix::thread::CpuSet::new();
        only.set(processor);
        let _ = rustix::thread::sched_setaffinity(None, &only);
    }
    #[cfg(not(target_os = "linux"))]
    let _ = processor;
    let mut stalled = Duration::ZERO;
    while !ends.load(Ordering::Relaxed) {
        let due = Instant::now() + TICK;
        thread::sleep(TICK);
        let late = due.elapsed();
        if late >= STALL {
            stalled += late;
        }
    }
    stalled
}
