//! Tests of what keeps real time, on machines that do not always: an arm has 15 ms for a reply, and a processor may be taken away
//! for longer.

use std::panic::resume_unwind;
use std::thread;
use std::time::Duration;

use cellwire::io::pauses::Watch;
use cellwire_io::clock::Clock;

/// A third of the window: shorter pauses of the machine explain no failure.
const PAUSE: Duration = Duration::from_millis(5);
/// A host whose processors stall for this fraction of the time cannot keep a cycle of 28 ms.
const UNFIT: u32 = 50;

/// Runs a test. Where it fails and the host was stalled meanwhile, it begins again; where the machine is unfit each time, nothing is
/// known of what was tested, and that is said.
pub(crate) fn in_real_time(test: impl Fn() + Sync) {
    let mut unfit = true;
    for attempt in 1.. {
        let clock = Clock::start();
        let watch = Watch::start(clock);
        // Of its own: a test may raise its thread's priority, which the watch must not have.
        let result = thread::scope(|scope| scope.spawn(&test).join());
        let (paused, time) = (watch.stop().total(), clock.now());
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
