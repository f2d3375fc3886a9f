//! A session in a task of its own.

use core::fmt;
use core::future::{Future, pending, poll_fn};
use core::ops::ControlFlow;
use core::pin::pin;
use core::task::Poll;
use core::time::Duration;
use std::boxed::Box;
use std::io;
use std::sync::Arc;
use std::thread::{Builder, JoinHandle};

use ::tokio::select;
use ::tokio::sync::{broadcast, mpsc, watch};
use ::tokio::time::{Instant, sleep};

use super::connection::{Connection, Inputs, Waited};
use super::slot::Slot;
use super::{Connector, Handle, Link, Reports, Service, Waker};
use crate::left::Left;
use crate::turn::prepare;
use crate::{STALL, Session, now};

/// How many calls wait in the task for room in the session; further ones wait at the caller.
const CALLS: usize = 16;
/// How many events are kept for who has not read them yet.
const EVENTS: usize = 256;
/// A session without a connection that is due is called as often as this at most.
const SHORTEST: Duration = Duration::from_millis(1);

/// A handle, and the task that executes its calls: `tokio::spawn(task.run())`, or [`Task::thread`].
pub fn spawn<S: Service, C: Connector>(
    session: S::Session,
    service: S,
    connector: C,
) -> (Handle<S>, Task<S, C>) {
    spawn_woken_by(Waker::default(), session, service, connector)
}

/// As [`spawn`], for a session with inputs other than bytes and time, whose hook was made with this waker.
pub fn spawn_woken_by<S: Service, C: Connector>(
    waker: Waker,
    session: S::Session,
    service: S,
    connector: C,
) -> (Handle<S>, Task<S, C>) {
    let (calls, calls_of_task) = mpsc::channel(CALLS);
    let (events_of_task, events) = broadcast::channel(EVENTS);
    let (link_of_task, link) = watch::channel(Link::Connecting);
    let (stop, stop_of_task) = watch::channel(false);
    let served = Served {
        session: Box::new(session),
        service,
        events: events_of_task,
        reconnect: None,
        has_reported: false,
    };
    let slot = Arc::new(Slot::default());
    let task = Task {
        served: Some(served),
        slot: Arc::clone(&slot),
        connector,
        calls: calls_of_task,
        link: link_of_task,
        stop: stop_of_task,
        waker: waker.clone(),
        reconnect: Reconnect::default(),
        stall: STALL,
    };
    (Handle { calls, events, link, stop: Arc::new(stop), waker, slot }, task)
}

/// Owns a session and its connections, one after the other. It ends with [`Handle::shutdown`], and with the last handle.
pub struct Task<S: Service, C> {
    /// Until it runs.
    served: Option<Served<S>>,
    slot: Arc<Slot<S>>,
    connector: C,
    calls: mpsc::Receiver<S::Call>,
    link: watch::Sender<Link>,
    stop: watch::Receiver<bool>,
    waker: Waker,
    reconnect: Reconnect,
    stall: Duration,
}

/// The delays of a [`Task`] before it reconnects: doubled after each attempt, and half of it random, so that many tasks that
/// lost the same peer do not reconnect at once. After a connection that lasted longer than the last pause it restarts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Reconnect {
    /// After the first. 100 ms.
    pub first: Duration,
    /// At most. 5 s.
    pub longest: Duration,
}

impl Default for Reconnect {
    fn default() -> Self {
        Self { first: Duration::from_millis(100), longest: Duration::from_secs(5) }
    }
}

/// Why a connection is over.
pub(super) enum Over {
    /// The task is to end.
    Stopped,
    /// Another one replaces it.
    Replaced,
    Lost(io::Error),
}

/// A session, and who gets its events.
pub(super) struct Served<S: Service> {
    /// Boxed: what a task returns is moved whenever it is polled.
    pub(super) session: Box<S::Session>,
    pub(super) service: S,
    events: broadcast::Sender<S::Event>,
    /// Why the connection is unusable.
    reconnect: Option<io::Error>,
    /// The service has got events since its state was stored.
    pub(super) has_reported: bool,
}

impl<S: Service, C: Connector> Task<S, C> {
    /// The delays before it reconnects.
    #[must_use]
    pub fn reconnect(self, reconnect: Reconnect) -> Self {
        Self { reconnect, ..self }
    }

    /// How long the peer may read nothing, if not [`STALL`].
    #[must_use]
    pub fn stall(self, stall: Duration) -> Self {
        Self { stall, ..self }
    }

    /// Runs it; gives the session back.
    pub async fn run(mut self) -> Box<S::Session> {
        let Reconnect { first, longest } = self.reconnect;
        let mut pause = first;
        let Some(mut served) = self.served.take() else { unreachable!("a task runs once") };
        if let Some(after) = served.session.discards_after() {
            self.connector.discard_after(after);
        }
        loop {
            let Self { connector, calls, stop, waker, .. } = &mut self;
            let Some(connected) = served.meanwhile(stop, waker, calls, connector.connect()).await else {
                break;
            };
            let has_connected = connected.is_ok();
            let error = match connected {
                Ok(transport) => {
                    let begun = Instant::now();
                    let over;
                    (served, over) = self.serve(served, transport).await;
                    if begun.elapsed() >= pause {
                        pause = first;
                    }
                    match over {
                        Over::Stopped => break,
                        Over::Replaced => continue,
                        Over::Lost(error) => error,
                    }
                }
                Err(error) => error,
            };
            let error = Arc::new(error);
            self.link.send_replace(Link::Failed(Arc::clone(&error)));
            // What waits when a connection is lost waits for the next one, unless there is none.
            while !has_connected
                && !S::OFFLINE
                && let Ok(call) = self.calls.try_recv()
            {
                served.service.refuse(call, &error);
            }
            if has_connected && !C::DIALS {
                continue;
            }
            let wait = sleep(pause.mul_f64(0.5 + fastrand::f64() / 2.0));
            let Self { calls, stop, waker, .. } = &mut self;
            if served.meanwhile(stop, waker, calls, wait).await.is_none() {
                break;
            }
            pause = pause.saturating_mul(2).min(longest);
        }
        self.calls.close();
        let error = Arc::new(io::Error::other("the task of the session has ended"));
        while let Some(call) = self.calls.recv().await {
            served.service.refuse(call, &error);
        }
        served.session
    }

    /// Runs it in a thread of its own: for programs without a runtime, whose calls any executor can wait for, such as
    /// `pollster::block_on`.
    ///
    /// # Errors
    /// The system has no thread or descriptor left.
    pub fn thread(self) -> io::Result<JoinHandle<Box<S::Session>>>
    where
        S: 'static,
        S::Session: 'static,
        C: 'static,
    {
        let runtime = ::tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        Builder::new().spawn(move || runtime.block_on(self.run()))
    }

    /// One connection, from its beginning to its end.
    async fn serve(&mut self, served: Served<S>, transport: C::Transport) -> (Served<S>, Over) {
        let Self { connector, calls, link, stop, waker, stall, slot, .. } = self;
        let mut over = pin!(over(stop, connector));
        let mut woken = pin!(waker.0.notified());
        let _open = slot.open();
        let mut connection = Box::new(Connection::new(served, Box::new(transport), *stall));
        connection.begin();
        link.send_replace(Link::Connected);
        let over = loop {
            match connection.prepare() {
                Ok(false) => {}
                Ok(true) => {
                    if let Err(over) = connection.keep(over.as_mut()).await {
                        break over;
                    }
                }
                Err(error) => break Over::Lost(error),
            }
            let mut inputs = Inputs { over: over.as_mut(), calls, woken: woken.as_mut(), waker };
            let mut awake = Some(connection);
            let waited;
            (connection, waited) = poll_fn(|context| {
                let mut connection = match awake.take() {
                    Some(connection) => connection,
                    None => {
                        let Some(mut connection) = slot.take(context) else { return Poll::Pending };
                        if let Some(handed_over) = connection.wake_up() {
                            return Poll::Ready((connection, Waited::HandedOver(handed_over)));
                        }
                        connection
                    }
                };
                match connection.poll(context, &mut inputs) {
                    Poll::Ready(waited) => Poll::Ready((connection, waited)),
                    Poll::Pending => {
                        slot.put(connection);
                        Poll::Pending
                    }
                }
            })
            .await;
            if let ControlFlow::Break(over) = connection.take(waited) {
                break over;
            }
        };
        (connection.end(), over)
    }
}

impl<S: Service> Served<S> {
    pub(super) fn has_room(&self) -> bool {
        self.service.has_room(&self.session)
    }

    /// Before a wait: reports events, and puts the bytes to be sent into `out`.
    pub(super) fn prepare(
        &mut self,
        left: &mut Left,
        out: &mut [u8],
        is_sending: bool,
        now: Duration,
    ) -> io::Result<()> {
        let Self { session, service, events, reconnect, has_reported } = self;
        let mut each = |session: &mut S::Session, event| {
            *has_reported = true;
            service.event(session, event, &mut Reports { events, reconnect });
            reconnect.take().map_or(ControlFlow::Continue(()), ControlFlow::Break)
        };
        match prepare(&mut **session, left, out, is_sending, || now, &mut each) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(error) => Err(error),
        }
    }

    /// Returns the time at which session or service are to be called at the latest.
    pub(super) fn due(&self, left: &Left, now: Duration) -> Option<Duration> {
        left.due(&*self.session, now).into_iter().chain(self.service.poll_timeout()).min()
    }

    fn call(&mut self, call: S::Call) {
        self.service.call(&mut self.session, now(), call);
    }

    /// Reports every event, where there is no connection that it could end.
    pub(super) fn report(&mut self) {
        let Self { session, service, events, reconnect, .. } = self;
        while let Some(event) = session.poll_event() {
            service.event(session, event, &mut Reports { events, reconnect });
        }
        self.reconnect = None;
    }

    /// Waits without a connection, for which the session keeps its deadlines. `None`: the task is to end.
    async fn meanwhile<T>(
        &mut self,
        stop: &mut watch::Receiver<bool>,
        waker: &Waker,
        calls: &mut mpsc::Receiver<S::Call>,
        wait: impl Future<Output = T>,
    ) -> Option<T> {
        let mut wait = pin!(wait);
        let mut stopped = pin!(stopped(stop));
        loop {
            let due = self.session.poll_timeout();
            let time = until(due.map(|at| at.max(now().saturating_add(SHORTEST))));
            let takes_calls = S::OFFLINE && self.has_room();
            select! {
                biased;
                () = &mut stopped => return None,
                value = &mut wait => return Some(value),
                call = calls.recv(), if takes_calls => self.call(call?),
                () = waker.woken() => {}
                () = time => {}
            }
            self.session.handle_timeout(now());
            self.report();
        }
    }
}

async fn until(at: Option<Duration>) {
    match at {
        None | Some(Duration::MAX) => pending().await,
        Some(at) => sleep(at.saturating_sub(now())).await,
    }
}

/// Waits for the end of the task, or for a connection that replaces this one.
async fn over(stop: &mut watch::Receiver<bool>, connector: &mut impl Connector) -> Over {
    select! {
        biased;
        () = stopped(stop) => Over::Stopped,
        () = connector.replaced() => Over::Replaced,
    }
}

/// The task is to end: on request, or because no handle is left.
async fn stopped(stop: &mut watch::Receiver<bool>) {
    let _ = stop.wait_for(|stop| *stop).await;
}

impl<S: Service, C> fmt::Debug for Task<S, C> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Task").field("reconnect", &self.reconnect).finish_non_exhaustive()
    }
}
