use std::hint::spin_loop;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Instant;

use core_affinity::CoreId;

/// If the round trip of a cache line takes fewer nanoseconds than this, the two processors share a core: two cores of one chip
/// may take 80.
pub(super) const ONE_CORE: f64 = 60.0;

/// Two processors; this thread is on the first.
pub(super) struct Cores {
    second: CoreId,
}

impl Cores {
    pub(super) fn find() -> Option<Self> {
        let ids = core_affinity::get_core_ids()?;
        let (&first, &second) = (ids.first()?, ids.get(1)?);
        core_affinity::set_for_current(first);
        Some(Cores { second })
    }

    /// Runs `run` on the other processor, and returns when it is about to begin.
    pub(super) fn second<R: Send + 'static>(
        &self,
        run: impl FnOnce() -> R + Send + 'static,
    ) -> thread::JoinHandle<R> {
        let core = self.second;
        let (ready, wait) = mpsc::channel();
        let thread = thread::spawn(move || {
            core_affinity::set_for_current(core);
            ready.send(()).unwrap();
            run()
        });
        wait.recv().unwrap();
        thread
    }

    /// Returns the round-trip time of a cache line, in nanoseconds.
    pub(super) fn cache_line(&self) -> f64 {
        const TURNS: u64 = 2_000;
        let line = Arc::new(AtomicU64::new(0));
        let echoed = line.clone();
        let echo = self.second(move || {
            for turn in 0..TURNS {
                while echoed.load(Ordering::Acquire) != 2 * turn + 1 {
                    spin_loop();
                }
                echoed.store(2 * turn + 2, Ordering::Release);
            }
        });
        let start = Instant::now();
        for turn in 0..TURNS {
            line.store(2 * turn + 1, Ordering::Release);
            while line.load(Ordering::Acquire) != 2 * turn + 2 {
                spin_loop();
            }
        }
        let time = start.elapsed();
        echo.join().unwrap();
        time.as_nanos() as f64 / TURNS as f64
    }
}
