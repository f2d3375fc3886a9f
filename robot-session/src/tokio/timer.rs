//! The timer of a connection.

use core::pin::Pin;
use core::task::{Context, Poll, Waker};
use core::time::Duration;
use std::boxed::Box;

use ::tokio::task::unconstrained;
use ::tokio::time::{Instant, Sleep, sleep_until};

use crate::std_driver::instant;

/// A timer for deadlines that mostly move to later times: it is set again only for an earlier deadline. When the time that
/// it is set to is over, it is set to the deadline of then.
#[derive(Debug, Default)]
pub(super) struct Timer(Option<ArmedTimer>);

#[derive(Debug)]
struct ArmedTimer {
    sleep: Pin<Box<Sleep>>,
    /// The time at which `sleep` ends; [`Duration::MAX`] if it has ended.
    at: Duration,
    /// The task that `sleep` wakes.
    waker: Option<Waker>,
}

impl Timer {
    /// Returns whether the task is woken in time without another [`poll`](Self::poll). A wait that has ended while nothing
    /// was due does not wake a task any more.
    pub(super) fn is_in_time(&self, due: Option<Duration>) -> bool {
        let Some(due) = reachable(due) else { return true };
        self.0.as_ref().is_some_and(|armed| armed.at <= due && !armed.sleep.is_elapsed())
    }

    /// Polls a wait until `due`. With `None` and [`Duration::MAX`] it never ends.
    pub(super) fn poll(&mut self, context: &mut Context<'_>, due: Option<Duration>) -> Poll<()> {
        let Some(due) = reachable(due) else { return Poll::Pending };
        let armed = match &mut self.0 {
            Some(armed) => armed,
            none => {
                let Some(end) = instant(due) else { return Poll::Pending };
                let sleep = Box::pin(sleep_until(Instant::from_std(end)));
                none.insert(ArmedTimer { sleep, at: due, waker: None })
            }
        };
        loop {
            if armed.at > due && !armed.set(due) {
                return Poll::Pending;
            }
            let ArmedTimer { sleep, at, waker } = &mut *armed;
            let is_known = waker.as_ref().is_some_and(|waker| waker.will_wake(context.waker()));
            if is_known && !sleep.is_elapsed() {
                return Poll::Pending;
            }
            // Unconstrained: a sleep that is pending for lack of budget has woken the task already, and does not wake it in time.
            if Pin::new(&mut unconstrained(sleep.as_mut())).poll(context).is_pending() {
                *waker = Some(context.waker().clone());
                return Poll::Pending;
            }
            let is_over = *at == due;
            *at = Duration::MAX;
            if is_over {
                return Poll::Ready(());
            }
        }
    }
}

/// Returns a deadline, unless it is never: [`Duration::MAX`].
fn reachable(due: Option<Duration>) -> Option<Duration> {
    due.filter(|due| *due < Duration::MAX)
}

impl ArmedTimer {
    /// Sets the timer to `due`. Returns false if no clock reaches that time.
    fn set(&mut self, due: Duration) -> bool {
        let Some(end) = instant(due) else { return false };
        self.sleep.as_mut().reset(Instant::from_std(end));
        (self.at, self.waker) = (due, None);
        true
    }
}
