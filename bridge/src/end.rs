//! The cell's end of the channels between the task of a cell and the hub.

use std::collections::{HashSet, VecDeque};
use std::future::pending;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde::Serialize;
use serde_json::Value as Json;
use tokio::sync::{mpsc, watch};
use tokio::{select, time};

use super::lease::Lease;
use super::metric::{self, CONNECTED, EVENT, NamedValue};
use super::payload::Value;
use super::report::{Command, Input, Outcome, Report, ReportBody};

/// The time that a command that has begun may take when the bridge ends.
pub const COMMAND_TIMEOUT: Duration = Duration::from_secs(5);

/// The reason to refuse a command that was not begun when the bridge ended.
pub const ENDS: &str = "not begun: the bridge ends, or the cell is changed";

/// The number of reasons that are reported of a device that does not answer.
const REASONS: usize = 20;
/// The interval at which a report that does not fit is tried again, and at which a task that is to end checks for its
/// command's outcome.
const RETRY_INTERVAL: Duration = Duration::from_millis(10);

/// The condition on which a cell's task ends.
#[derive(Debug, Clone)]
pub struct Stop {
    /// True when the task is to end; closed when its cell is gone.
    told: watch::Receiver<bool>,
    /// The lease, if several bridges share the cell.
    lease: Option<Arc<Lease>>,
}

impl Stop {
    /// Makes the condition: `told` is true or closed, or the lease is lost.
    pub fn new(told: watch::Receiver<bool>, lease: Option<Arc<Lease>>) -> Self {
        Self { told, lease }
    }

    fn is_due(&self) -> bool {
        *self.told.borrow() || self.told.has_changed().is_err() || self.is_lost()
    }

    /// Returns whether the cell may be another bridge's.
    fn is_lost(&self) -> bool {
        self.lease.as_ref().is_some_and(|lease| !lease.holds())
    }

    /// Waits until the task is to end.
    async fn due(&self) {
        let mut told = self.told.clone();
        let lost = async {
            match &self.lease {
                None => pending().await,
                Some(lease) => {
                    while lease.holds() {
                        time::sleep(lease.left()).await;
                    }
                }
            }
        };
        select! {
            _ = told.wait_for(|told| *told) => {}
            () = lost => {}
        }
    }
}

/// The commands of a cell.
#[derive(Debug)]
pub struct Inbox(pub mpsc::UnboundedReceiver<Command>);

impl Inbox {
    /// Returns the next command, one at a time. A command that has waited too long is refused, and so is each once the task is to
    /// end.
    pub async fn next(&mut self, end: &End) -> Command {
        loop {
            match self.0.recv().await {
                Some(command) if end.begins(&command) => return command,
                Some(_) => {}
                None => pending().await,
            }
        }
    }

    /// Returns the next command as [`next`](Self::next) does, without a wait.
    pub fn try_next(&mut self, end: &End) -> Option<Command> {
        loop {
            let command = self.0.try_recv().ok()?;
            if end.begins(&command) {
                return Some(command);
            }
        }
    }

    /// Refuses the commands that wait.
    pub fn refuse(&mut self, end: &End, why: &str) {
        while let Some(_command) = self.try_next(end) {
            end.finish(Outcome::Refused, why);
        }
    }
}

/// The end of a cell's task. No method waits: reports that must not be lost wait for free space at the hub until
/// [`flush`](Self::flush).
#[derive(Debug)]
pub struct End {
    cell: usize,
    place: String,
    hub: SyncSender<Input>,
    stop: Stop,
    dropped: Arc<AtomicU64>,
    /// The number of failures while the device did not answer.
    failures: Arc<AtomicU64>,
    state: Mutex<State>,
}

/// The state of the device and of its command.
#[derive(Debug, Default)]
struct State {
    /// The command that has no outcome yet.
    current: Option<String>,
    /// The time at which it was noticed first that the task is to end.
    stopped_at: Option<Instant>,
    /// The number of connections so far, and whether there is one now.
    connections: u64,
    is_linked: bool,
    /// Whether the device answers, and the time at which it did last.
    is_alive: bool,
    heard: Option<Instant>,
    /// Whether there is a record, since the device answered last, that it does not answer.
    is_recorded: bool,
    /// The reasons that were reported since it answered last.
    reported: HashSet<String>,
    /// Reports that did not fit into the queue of the hub.
    unsent: VecDeque<Input>,
}

impl End {
    /// Makes the end of the cell of this number, whose device is at `place`.
    pub fn new(
        cell: usize,
        place: String,
        hub: SyncSender<Input>,
        stop: Stop,
        dropped: Arc<AtomicU64>,
        failures: Arc<AtomicU64>,
    ) -> Self {
        Self { cell, place, hub, stop, dropped, failures, state: Mutex::default() }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns whether the bridge ends, or the cell is not its own any more.
    pub fn is_stopped(&self) -> bool {
        self.stop.is_due()
    }

    /// Returns whether the task is to end now: it is stopped, and its command has an outcome, or has had [`COMMAND_TIMEOUT`]
    /// to get one. A cell that another bridge may have is given up at once.
    pub fn is_over(&self) -> bool {
        if !self.is_stopped() {
            return false;
        }
        let mut state = self.state();
        let since = *state.stopped_at.get_or_insert_with(Instant::now);
        state.current.is_none() || self.stop.is_lost() || since.elapsed() >= COMMAND_TIMEOUT
    }

    /// Waits until [it is over](Self::is_over).
    pub async fn over(&self) {
        self.stop.due().await;
        while !self.is_over() {
            time::sleep(RETRY_INTERVAL).await;
        }
    }

    /// Reports values of a device that answers. The link never waits: reports without room are dropped and counted.
    pub fn values(&self, values: Vec<NamedValue>) {
        let state = self.state();
        if state.is_alive {
            self.report(&state, values);
        }
    }

    fn report(&self, state: &State, values: Vec<NamedValue>) {
        let report = Report { at: metric::now(), body: ReportBody::Values(values) };
        let has_room = state.unsent.is_empty();
        let sent = has_room.then(|| self.hub.try_send(Input::Cell(self.cell, report)));
        if matches!(sent, None | Some(Err(TrySendError::Full(_)))) {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Returns whether the device answers.
    pub fn is_alive(&self) -> bool {
        self.state().is_alive
    }

    /// Reports an event, as an object of JSON. While the device does not answer, it is counted, and logged once.
    pub fn event(&self, event: &impl Serialize) {
        let text = serde_json::to_string(event).unwrap_or_default();
        let mut state = self.state();
        if state.is_alive {
            self.report(&state, vec![(EVENT, Value::String(text))]);
        } else if self.is_news(&mut state, &text) {
            self.send(&mut state, ReportBody::Failed(text));
        }
    }

    /// Counts a failure. Returns whether this reason was not reported since the device answered last.
    fn is_news(&self, state: &mut State, why: &str) -> bool {
        self.failures.fetch_add(1, Ordering::Relaxed);
        // A device that gives another reason each time does not make all of them remembered.
        state.reported.len() < REASONS && state.reported.insert(why.to_owned())
    }

    /// Reports the device's values as implausible, with the reason as an event. Its metrics have no values until it reports
    /// others.
    pub fn bad(&self, event: &Json) {
        let body = ReportBody::Bad(vec![(EVENT, Value::String(event.to_string()))]);
        self.send(&mut self.state(), body);
    }

    /// Reports a connection. It shows nothing of the device.
    pub fn linked(&self) {
        let mut state = self.state();
        (state.is_linked, state.heard) = (true, Some(Instant::now()));
        state.connections += 1;
    }

    /// Returns the number of connections so far.
    pub fn connections(&self) -> u64 {
        self.state().connections
    }

    /// Returns the time at which the device answered last, or the connection was made.
    pub fn heard(&self) -> Option<Instant> {
        self.state().heard
    }

    /// Reports that the device has answered.
    pub fn answered(&self) {
        let mut state = self.state();
        state.heard = Some(Instant::now());
        if !state.is_alive {
            self.is_connected(&mut state, &self.place);
        }
    }

    /// Reports that the device at `place` answers.
    pub fn connected(&self, place: &str) {
        self.is_connected(&mut self.state(), place);
    }

    fn is_connected(&self, state: &mut State, place: &str) {
        state.reported.clear();
        (state.is_alive, state.is_recorded) = (true, false);
        self.link(state, true, &serde_json::json!({"event": "connected", "place": place}));
    }

    /// Reports that the connection has not been made, or has ended.
    pub fn unlinked(&self, why: &str) {
        self.state().is_linked = false;
        self.disconnected(why);
    }

    /// Reports that the device does not answer, and why: one record, and a line of the log for each reason.
    pub fn disconnected(&self, why: &str) {
        let state = &mut *self.state();
        state.is_alive = false;
        if self.is_news(state, why) {
            let event = serde_json::json!({"event": "disconnected", "why": why});
            match core::mem::replace(&mut state.is_recorded, true) {
                false => self.link(state, false, &event),
                true => self.send(state, ReportBody::Failed(event.to_string())),
            }
        }
    }

    fn link(&self, state: &mut State, is_connected: bool, event: &Json) {
        let values =
            vec![(CONNECTED, Value::Boolean(is_connected)), (EVENT, Value::String(event.to_string()))];
        self.send(state, ReportBody::Values(values));
    }

    /// Returns the reason why a command cannot be given to the device now. One that [is asked](crate::links) must have
    /// answered.
    pub fn refusal(&self, is_asked: bool) -> Option<&'static str> {
        let state = self.state();
        match (state.is_linked, state.is_alive || !is_asked) {
            (false, _) => Some("the link is not connected"),
            (true, false) => Some("the device does not answer"),
            (true, true) => None,
        }
    }

    /// Returns whether a command is begun; otherwise it is refused.
    fn begins(&self, command: &Command) -> bool {
        self.state().current = Some(command.id.clone());
        if self.is_stopped() {
            self.finish(Outcome::Refused, ENDS);
        } else if metric::now() > command.until {
            self.finish(Outcome::Refused, "it waited longer than commands.max_age");
        } else {
            return true;
        }
        false
    }

    /// Returns whether a command has no outcome yet.
    pub fn is_busy(&self) -> bool {
        self.state().current.is_some()
    }

    /// Reports the outcome of the command that is under way.
    pub fn finish(&self, outcome: Outcome, detail: impl Into<String>) {
        let mut state = self.state();
        if let Some(id) = state.current.take() {
            self.send(&mut state, ReportBody::Outcome { id, outcome, detail: detail.into() });
        }
    }

    /// Waits for room at the hub for reports that must not be lost.
    fn send(&self, state: &mut State, body: ReportBody) {
        state.unsent.push_back(Input::Cell(self.cell, Report { at: metric::now(), body }));
        self.try_flush(state);
    }

    /// Sends the reports that wait; returns whether all are sent.
    fn try_flush(&self, state: &mut State) -> bool {
        while let Some(report) = state.unsent.pop_front() {
            if let Err(TrySendError::Full(report)) = self.hub.try_send(report) {
                state.unsent.push_front(report);
                return false;
            }
        }
        true
    }

    /// Waits until the hub has every report that must not be lost.
    pub async fn flush(&self) {
        while !self.try_flush(&mut self.state()) {
            time::sleep(RETRY_INTERVAL).await;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, sync_channel};

    use super::*;

    /// Returns the end of cell 3, and the receiver of its reports.
    fn end(failures: &Arc<AtomicU64>) -> (End, Receiver<Input>, watch::Sender<bool>) {
        let ((hub, reports), (stop, told)) = (sync_channel(9), watch::channel(false));
        let stop_of_end = Stop::new(told, None);
        (End::new(3, "x".into(), hub, stop_of_end, Arc::default(), Arc::clone(failures)), reports, stop)
    }

    #[test]
    fn a_command_that_has_waited_too_long_is_not_begun() {
        let ((end, reports, _stop), (commands, inbox)) = (end(&Arc::default()), mpsc::unbounded_channel());
        let mut inbox = Inbox(inbox);
        let now = metric::now();
        for (id, until) in [("first", now + 60_000), ("late", now - 1), ("next", now + 60_000)] {
            commands.send(Command { id: id.into(), order: serde_json::Map::new(), until }).unwrap();
        }
        assert_eq!(inbox.try_next(&end).map(|command| command.id), Some("first".into()));
        end.finish(Outcome::Done, "");
        assert_eq!(inbox.try_next(&end).map(|command| command.id), Some("next".into()));
        end.finish(Outcome::Done, "");
        let outcomes = reports.try_iter().map(|input| match input {
            Input::Cell(3, Report { body: ReportBody::Outcome { id, outcome, detail }, .. }) => {
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
        let failures = Arc::default();
        let (end, reports, _stop) = end(&failures);
        let attempt = |answers: bool| {
            if answers {
                end.answered();
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

    #[test]
    fn what_must_not_be_lost_waits_for_room_and_values_do_not() {
        let (end, reports, _stop) = end(&Arc::default());
        end.answered();
        for _ in 0..10 {
            end.values(vec![("v", Value::Boolean(true))]);
        }
        assert_eq!(end.dropped.load(Ordering::Relaxed), 2);
        end.disconnected("closed");
        end.answered();
        end.values(vec![("v", Value::Boolean(true))]);
        assert_eq!((reports.try_iter().count(), end.dropped.load(Ordering::Relaxed)), (9, 3));
        assert!(end.try_flush(&mut end.state()));
        assert_eq!(reports.try_iter().count(), 2);
    }

    #[test]
    fn a_task_that_is_to_end_begins_nothing_and_waits_for_the_outcome_of_its_command() {
        let ((end, reports, stop), (commands, inbox)) = (end(&Arc::default()), mpsc::unbounded_channel());
        let (mut inbox, until) = (Inbox(inbox), metric::now() + 60_000);
        for id in ["first", "next"] {
            commands.send(Command { id: id.into(), order: serde_json::Map::new(), until }).unwrap();
        }
        assert!(inbox.try_next(&end).is_some());
        stop.send_replace(true);
        assert!(!end.is_over());
        end.finish(Outcome::Done, "");
        assert!(end.is_over());
        inbox.refuse(&end, "");
        let details = reports.try_iter().filter_map(|input| match input {
            Input::Cell(3, Report { body: ReportBody::Outcome { detail, .. }, .. }) => Some(detail),
            _ => None,
        });
        assert_eq!(details.collect::<Vec<_>>(), ["", ENDS]);
    }
}
