//! The cell's end of the channels between the thread of a cell and the hub.

use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError};
use std::time::{Duration, Instant};

use serde::Serialize;
use serde_json::Value as Json;

use super::lease::Lease;
use super::metric::{self, CONNECTED, EVENT, Named};
use super::payload::Value;
use super::report::{Command, Input, Outcome, Report, What};

/// How long a command that has begun may take when the bridge ends.
pub const LAST: Duration = Duration::from_secs(5);

/// The reason to refuse a command that was not begun when the bridge ended.
pub const ENDS: &str = "not begun: the bridge ends, or the cell is changed";

/// How many reasons of a device that does not answer are reported.
const REASONS: usize = 20;

/// When a cell's thread is to end.
#[derive(Debug, Clone, Default)]
pub struct Stop {
    /// It is told to.
    pub flag: Arc<AtomicBool>,
    /// What a cell that bridges share has to have.
    pub lease: Option<Arc<Lease>>,
}

impl Stop {
    fn is_due(&self) -> bool {
        self.flag.load(Ordering::Relaxed) || self.is_lost()
    }

    /// The cell may be another bridge's.
    fn is_lost(&self) -> bool {
        self.lease.as_ref().is_some_and(|lease| !lease.holds())
    }
}

/// The end of a cell's thread.
#[derive(Debug)]
pub struct End {
    cell: usize,
    hub: SyncSender<Input>,
    commands: Receiver<Command>,
    stop: Stop,
    dropped: Arc<AtomicU64>,
    /// The command that has no outcome yet.
    current: Option<String>,
    /// When it was noticed first that the thread is to end.
    stopped_at: Option<Instant>,
    /// Whether the device answers.
    is_alive: bool,
    /// Whether there is a record since it answered last that it does not.
    is_recorded: bool,
    /// The reasons that were reported since it answered last.
    reported: HashSet<String>,
    /// The number of failures while it did not answer.
    failures: Arc<AtomicU64>,
}

impl End {
    /// The end of the cell of this number.
    pub fn new(
        cell: usize,
        hub: SyncSender<Input>,
        commands: Receiver<Command>,
        stop: Stop,
        dropped: Arc<AtomicU64>,
        failures: Arc<AtomicU64>,
    ) -> Self {
        Self {
            cell,
            hub,
            commands,
            stop,
            dropped,
            current: None,
            stopped_at: None,
            is_alive: false,
            is_recorded: false,
            reported: HashSet::new(),
            failures,
        }
    }

    /// Whether the bridge ends, or the cell is not its own any more.
    pub fn is_stopped(&self) -> bool {
        self.stop.is_due()
    }

    /// Whether the thread is to end now: it is stopped, and its command has an outcome, or has had [`LAST`] to get one. A cell that
    /// another bridge may have is given up at once.
    pub fn is_over(&mut self) -> bool {
        if !self.is_stopped() {
            return false;
        }
        let since = *self.stopped_at.get_or_insert_with(Instant::now);
        self.current.is_none() || self.stop.is_lost() || since.elapsed() >= LAST
    }

    /// Reports values of a device that answers. The link never waits: reports without room are dropped and counted.
    pub fn values(&self, values: Vec<Named>) {
        if self.is_alive {
            self.report(values);
        }
    }

    fn report(&self, values: Vec<Named>) {
        let report = Report { at: metric::now(), what: What::Values(values) };
        if let Err(TrySendError::Full(_)) = self.hub.try_send(Input::Cell(self.cell, report)) {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Whether the device answers.
    pub fn is_alive(&self) -> bool {
        self.is_alive
    }

    /// Reports an event, as an object of JSON. While the device does not answer, it is counted, and logged once.
    pub fn event(&mut self, event: &impl Serialize) {
        let text = serde_json::to_string(event).unwrap_or_default();
        if self.is_alive {
            self.report(vec![(EVENT, Value::String(text))]);
        } else if self.is_news(&text) {
            self.send(What::Failed(text));
        }
    }

    /// Counts a failure. Returns whether this reason was not reported since the device answered last.
    fn is_news(&mut self, why: &str) -> bool {
        self.failures.fetch_add(1, Ordering::Relaxed);
        // A device that gives another reason each time does not make all of them remembered.
        self.reported.len() < REASONS && self.reported.insert(why.to_owned())
    }

    /// Reports that what the device reports cannot be, with an event that says why: its metrics have no values until it reports others.
    pub fn bad(&self, event: &Json) {
        self.send(What::Bad(vec![(EVENT, Value::String(event.to_string()))]));
    }

    /// The device answers.
    pub fn connected(&mut self, place: &str) {
        self.reported.clear();
        (self.is_alive, self.is_recorded) = (true, false);
        self.link(true, &serde_json::json!({"event": "connected", "place": place}));
    }

    /// The device does not answer, and why: one record, and a line of the log for each reason.
    pub fn disconnected(&mut self, why: &str) {
        self.is_alive = false;
        if self.is_news(why) {
            let event = serde_json::json!({"event": "disconnected", "why": why});
            match core::mem::replace(&mut self.is_recorded, true) {
                false => self.link(false, &event),
                true => self.send(What::Failed(event.to_string())),
            }
        }
    }

    fn link(&self, is_connected: bool, event: &Json) {
        let values =
            vec![(CONNECTED, Value::Boolean(is_connected)), (EVENT, Value::String(event.to_string()))];
        self.send(What::Values(values));
    }

    /// The next command, one at a time. One that has waited too long behind others is refused.
    pub fn command(&mut self) -> Option<Command> {
        while self.current.is_none() && !self.is_stopped() {
            let command = self.commands.try_recv().ok()?;
            self.current = Some(command.id.clone());
            if metric::now() <= command.until {
                return Some(command);
            }
            self.finish(Outcome::Refused, "it waited longer than commands.max_age");
        }
        None
    }

    /// Whether a command has no outcome yet.
    pub fn is_busy(&self) -> bool {
        self.current.is_some()
    }

    /// The outcome of the command that had none.
    pub fn finish(&mut self, outcome: Outcome, detail: impl Into<String>) {
        if let Some(id) = self.current.take() {
            self.send(What::Outcome { id, outcome, detail: detail.into() });
        }
    }

    /// Waits while there is no connection; commands are refused meanwhile. False when the bridge ends.
    pub fn wait(&mut self, time: Duration) -> bool {
        let until = Instant::now() + time;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            match self.commands.recv_timeout(left.min(Duration::from_millis(100))) {
                Ok(Command { id, .. }) => {
                    self.current = Some(id);
                    let why = if self.is_stopped() { ENDS } else { "the link is not connected" };
                    self.finish(Outcome::Refused, why);
                }
                Err(RecvTimeoutError::Timeout) if left.is_zero() => return !self.is_stopped(),
                Err(RecvTimeoutError::Timeout) if !self.is_stopped() => {}
                Err(_) => return false,
            }
        }
    }

    /// What must not be lost waits for the hub.
    fn send(&self, what: What) {
        let _ = self.hub.send(Input::Cell(self.cell, Report { at: metric::now(), what }));
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{channel, sync_channel};

    use super::*;

    #[test]
    fn a_command_that_has_waited_too_long_is_not_begun() {
        let ((hub, reports), (commands, inbox)) = (sync_channel(9), channel());
        let mut end = End::new(3, hub, inbox, Stop::default(), Arc::default(), Arc::default());
        let now = metric::now();
        for (id, until) in [("first", now + 60_000), ("late", now - 1), ("next", now + 60_000)] {
            commands.send(Command { id: id.into(), order: serde_json::Map::new(), until }).unwrap();
        }
        assert_eq!(end.command().map(|command| command.id), Some("first".into()));
        assert_eq!(end.command(), None);
        end.finish(Outcome::Done, "");
        assert_eq!(end.command().map(|command| command.id), Some("next".into()));
        end.finish(Outcome::Done, "");
        let outcomes = reports.try_iter().map(|input| match input {
            Input::Cell(3, Report { what: What::Outcome { id, outcome, detail }, .. }) => {
                (id, outcome, detail)
            }
            other => panic!("{other:?}"),
        });
        let why = "it waited longer than commands.max_age";
        assert_eq!(
            outcomes.collect::<Vec<_>>(),
            [("first", Outcome::Done, ""), ("late", Outcome::Refused, why), ("next", Outcome::Done, "")]
                .map(|(id, outcome, detail)| (id.to_owned(), outcome, detail.to_owned()))
        );
    }

    #[test]
    fn what_fails_before_the_device_answers_is_counted_and_reported_once() {
        let ((hub, reports), (_commands, inbox), failures) = (sync_channel(9), channel(), Arc::default());
        let mut end = End::new(3, hub, inbox, Stop::default(), Arc::default(), Arc::clone(&failures));
        let mut attempt = |answers: bool| {
            if answers {
                end.connected("x");
            }
            end.values(vec![("v", Value::Boolean(true))]);
            end.event(&"failed");
            end.disconnected("closed");
            (reports.try_iter().count(), failures.load(Ordering::Relaxed))
        };
        assert_eq!([attempt(false), attempt(false), attempt(true)], [(2, 2), (0, 4), (4, 5)]);
        // It has answered: its reasons are news again.
        assert_eq!([attempt(false), attempt(false)], [(1, 7), (0, 9)]);
    }
}
