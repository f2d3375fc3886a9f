//! A cell whose device has a handle: the events of its connections, and the bridge's requests to it.

use std::convert::Infallible;
use std::future::{Future, pending};
use std::io;
use std::pin::pin;
use std::time::Duration;

use robot_session::tokio::{Connector, Handle, Link, Reconnect, Service, Task};
use serde_json::json;
use tokio::select;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::watch;
use tokio::time::{Instant, sleep_until};

use super::Client;
use crate::end::{End, Inbox};
use crate::metric::Definition;
use crate::report::{Command, Outcome};
use crate::site::Cell;
use cellwire_io::latency::Deadline;
use cellwire_links::settings::FieldVisitor;

/// The pauses before the next connection.
const PAUSES: Reconnect = Reconnect { first: Duration::from_millis(250), longest: Duration::from_secs(10) };
/// The interval at which a device that is never silent is checked.
const IDLE_CHECK_INTERVAL: Duration = Duration::from_secs(86_400);

/// The silence after which a device counts as dead.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Silence {
    /// The duration of the silence; zero: never, the device counts as alive while it is connected.
    pub time: Duration,
    /// Whether the device answers requests. If it does not answer, it has not noticed the connection, which is then reopened. Any
    /// other device speaks by itself, and may begin at any time.
    pub is_asked: bool,
}

impl Silence {
    /// Makes the silence of a device that sends unsolicited messages.
    pub(super) fn of_speaker(time: Duration) -> Self {
        Self { time, is_asked: false }
    }

    /// Makes the silence of a device whose session itself ends the connection if it is silent.
    pub(super) fn of_session() -> Self {
        Self { time: IDLE_CHECK_INTERVAL, is_asked: true }
    }

    /// Makes the silence of a device polled with this period: at least three requests without an answer.
    pub(super) fn of_asked(time: Duration, every: Duration) -> Self {
        let time = if time.is_zero() { time } else { time.max(every.saturating_mul(3)) };
        Self { time, is_asked: true }
    }

    /// Lists the setting of the silence.
    pub(super) fn configure(fields: &mut impl FieldVisitor, time: &mut Duration) {
        let range = Duration::ZERO..=Duration::from_secs(3600);
        let about = "the silence, of at least three requests, after which the device is dead; 0s: never while connected";
        fields.time("silence", range, about, time);
    }
}

/// Reports the events of a device.
pub(super) trait Listener: Send + 'static {
    /// The device's handle.
    type Service: Service<Event: Send> + 'static;

    /// Reports an event. Only a connection that is best given up is an error.
    ///
    /// # Errors
    /// The reason to give up the connection.
    fn event(&mut self, event: <Self::Service as Service>::Event, end: &End) -> Result<(), String>;
}

/// Works with a device, one thing after the other.
pub(super) trait Worker: Send + 'static {
    /// Called when there is another connection.
    fn reconnected(&mut self) {}

    /// Asks for the values, and reports them. A worker without a period is never called.
    fn poll(&mut self, _end: &End) -> impl Future<Output = ()> + Send {
        pending()
    }

    /// Has the device execute a command; returns the outcome and the reason.
    fn command(&mut self, command: &Command, end: &End) -> impl Future<Output = (Outcome, String)> + Send;

    /// Returns the detail of a command that has no outcome when the cell ends, with the reason of the end.
    fn unfinished(&self, why: &str, _end: &End) -> String {
        format!("the connection has ended: {why}")
    }
}

/// Refuses every command, with this reason.
pub(super) struct RejectAll(pub &'static str);

impl Worker for RejectAll {
    async fn command(&mut self, _: &Command, _: &End) -> (Outcome, String) {
        (Outcome::Refused, self.0.into())
    }
}

/// The terms of requests to a device.
#[derive(Debug, Clone, Copy)]
pub(super) struct PollSettings {
    /// The silence after which the device counts as dead.
    pub silence: Silence,
    /// The period with which the device's values are polled, if it is polled.
    pub every: Option<Duration>,
    /// The deadline that a USB adapter may miss.
    pub deadline: Option<Deadline>,
}

/// Makes the client of a cell whose device has a handle.
pub(super) fn of<L, W, C>(
    cell: &Cell,
    metrics: &'static [Definition],
    terms: PollSettings,
    (handle, task): (Handle<L::Service>, Task<L::Service, C>),
    mut listener: L,
    mut worker: W,
) -> Client
where
    L: Listener,
    W: Worker,
    C: Connector + 'static,
    <L::Service as Service>::Session: 'static,
    <L::Service as Service>::Call: 'static,
    <L::Service as Service>::Event: 'static,
{
    let task = task.reconnect(PAUSES).connect_pause(cell.connect_pause);
    let place = cell.address.clone().unwrap_or_default();
    let advice = move || terms.deadline.and_then(|deadline| deadline.advice(&place));
    Client::new(metrics, async move |end: End, mut inbox: Inbox| {
        tokio::spawn(task.run());
        let link = handle.link();
        let why = select! {
            biased;
            why = watch_over(&handle, terms.silence, advice, &mut listener, &end) => why,
            never = work(link, terms, &mut worker, &mut inbox, &end) => match never {},
        };
        end.finish(Outcome::Unknown, worker.unfinished(&why, &end));
        handle.shutdown().await;
        end.unlinked(&why);
        inbox.refuse(&end, &why);
        end.flush().await;
    })
}

/// Reports the state of the connection and the events, until the cell is over.
async fn watch_over<L: Listener>(
    handle: &Handle<L::Service>,
    silence: Silence,
    advice: impl Fn() -> Option<String>,
    listener: &mut L,
    end: &End,
) -> String {
    let (mut link, mut events) = (handle.link(), handle.events());
    // Once: another attempt opens the same port.
    let mut advice = Some(advice);
    let mut over = pin!(end.over());
    let limit = if silence.time.is_zero() { IDLE_CHECK_INTERVAL } else { silence.time };
    let mut check = pin!(sleep_until(Instant::now() + limit));
    loop {
        select! {
            biased;
            () = end.flush() => {}
            () = &mut over => return "the bridge ends".into(),
        }
        select! {
            biased;
            () = &mut over => return "the bridge ends".into(),
            Ok(()) = link.changed() => {
                let now = link.borrow_and_update().clone();
                match now {
                    Link::Connecting => {}
                    Link::Connected => {
                        if let Some(why) = advice.take().and_then(|advice| advice()) {
                            end.event(&json!({"event": "slow_adapter", "why": why}));
                        }
                        end.linked();
                        if silence.time.is_zero() {
                            end.answered();
                        }
                        check.as_mut().reset(Instant::now() + limit);
                    }
                    Link::Failed(why) => end.unlinked(&why.to_string()),
                    Link::Ended => return "the task of the device has ended".into(),
                }
            }
            event = events.recv() => match event {
                Ok(event) => {
                    if let Err(why) = listener.event(event, end) {
                        handle.reconnect(io::Error::other(why));
                    }
                }
                Err(RecvError::Lagged(_)) => {}
                Err(RecvError::Closed) => return "the task of the device has ended".into(),
            },
            () = &mut check => {
                let now = Instant::now();
                let due = end.heard().map_or(now + limit, |heard| Instant::from_std(heard) + limit);
                check.as_mut().reset(if due > now { due } else { now + limit });
                if due <= now && !silence.time.is_zero() {
                    silent(handle, silence, end);
                }
            }
        }
    }
}

/// Reports that the device was silent for too long, if there is a connection.
fn silent<S: Service>(handle: &Handle<S>, silence: Silence, end: &End) {
    let is_linked = matches!(*handle.link().borrow(), Link::Connected);
    let why = format!("the device has not answered for {}", humantime::format_duration(silence.time));
    match silence.is_asked {
        true if is_linked => handle.reconnect(io::Error::other(why)),
        false if is_linked && end.is_alive() => end.disconnected(&why),
        _ => {}
    }
}

/// Runs the work that is due, one item after the other.
async fn work<W: Worker>(
    mut link: watch::Receiver<Link>,
    PollSettings { silence, every, .. }: PollSettings,
    worker: &mut W,
    inbox: &mut Inbox,
    end: &End,
) -> Infallible {
    let (mut next, mut connections) = (Instant::now(), 0);
    loop {
        let due = async {
            if every.is_none() {
                pending().await
            }
            loop {
                // Without a task there is no device to poll.
                if link.wait_for(|link| matches!(link, Link::Connected)).await.is_err() {
                    pending().await
                }
                if end.connections() != connections {
                    return;
                }
                select! {
                    biased;
                    _ = link.changed() => {}
                    () = sleep_until(next) => return,
                }
            }
        };
        select! {
            biased;
            command = inbox.next(end) => {
                let (outcome, why) = match end.refusal(silence.is_asked) {
                    Some(why) => (Outcome::Refused, why.into()),
                    None => worker.command(&command, end).await,
                };
                end.finish(outcome, why);
            }
            () = due => {
                let now = Instant::now();
                if core::mem::replace(&mut connections, end.connections()) != connections {
                    worker.reconnected();
                    next = now;
                }
                next = (next + every.unwrap_or(IDLE_CHECK_INTERVAL)).max(now); // a late one skips what it missed
                worker.poll(end).await;
            }
        }
    }
}
