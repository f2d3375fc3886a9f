//! The times at which the session is to be called, and at which the main loop continues.

use core::cell::Cell;
use core::time::Duration;

use critical_section::Mutex;

use crate::{chip, core_of, now};

/// The longest time of an alarm: for a later deadline the session is called early, and returns the deadline again.
const MAX_ALARM: Duration = Duration::from_secs(60);

/// The two times.
#[derive(Clone, Copy)]
pub(crate) struct Times {
    pub(crate) session: Option<Duration>,
    pub(crate) main: Option<Duration>,
}

static TIMES: Mutex<Cell<Times>> = Mutex::new(Cell::new(Times { session: None, main: None }));

/// Changes the times. The alarm calls the session, which does nothing before its time, and wakes the main loop.
pub(crate) fn set(change: impl FnOnce(&mut Times)) {
    critical_section::with(|cs| {
        let mut times = TIMES.borrow(cs).get();
        change(&mut times);
        TIMES.borrow(cs).set(times);
        let now = now();
        if times.session.is_some_and(|at| at <= now) {
            core_of::trigger_session();
        }
        // The main loop looks at its own before it sleeps.
        let later = [times.session, times.main].into_iter().flatten().filter(|at| *at > now);
        match later.min() {
            Some(at) => chip::set_alarm((at - now).min(MAX_ALARM)),
            None => chip::clear_alarm(),
        }
    });
}
