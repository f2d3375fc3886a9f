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

use ::tokio::sync::{broadcast, mpsc, watch};
use ::tokio::time::{Instant, sleep};

use super::connection::{Connection, ConnectionEnd, Inputs, WaitResult};
use super::served::ServedSession;
use super::shared::{Link, LinkState, Shared, TaskChannels};
use super::{Connector, Handle, Reports, Service, Waker};
use crate::machine::is_due;
use crate::trace::{self, Span};
use crate::{STALL, Session, now};

/// The number of calls that wait in the task for the session; further ones wait at the caller.
const CALLS: usize = 16;
/// The number of events that are buffered for slow readers.
const EVENTS: usize = 256;
/// The shortest time between two times at which calls fail.
const MIN_FAIL_INTERVAL: Duration = Duration::from_millis(10);
/// The shortest interval between two calls of a session that is due without a connection.
const MIN_CALL_INTERVAL: Duration = Duration::from_millis(1);

/// Creates a handle, and the task that executes its calls: `tokio::spawn(task.run())`, or [`Task::thread`].
pub fn spawn<S: Service, C: Connector>(
    session: S::Session,
    service: S,
    connector: C,
) -> (Handle<S>, Task<S, C>) {
    spawn_woken_by(Waker::default(), session, service, connector)
}

/// As [`spawn`], for a session with inputs other than bytes and time. The hook of these inputs was made with `waker`.
pub fn spawn_woken_by<S: Service, C: Connector>(
    waker: Waker,
    session: S::Session,
    service: S,
    connector: C,
) -> (Handle<S>, Task<S, C>) {
    let (calls, calls_of_task) = mpsc::channel(CALLS);
    let (events_of_task, events) = broadcast::channel(EVENTS);
    let (link_of_task, link) = LinkState::new();
    let (stop, stop_of_task) = watch::channel(None);
    let served = ServedSession {
        session: Box::new(session),
        service,
        events: events_of_task,
        reconnect: None,
        has_reported: false,
    };
    let shared = Arc::new(Shared::new(TaskChannels { calls: calls_of_task, link: link_of_task }));
    let task = Task {
        served,
        unrun: Ends(Arc::clone(&shared)),
        connector,
        stop: stop_of_task,
        waker: waker.clone(),
        reconnect: Reconnect::default(),
        connect_pause: Duration::ZERO,
        stall: STALL,
        give_up_after: GIVE_UP_AFTER,
    };
    (Handle { calls, events, link, stop: Arc::new(stop), waker, shared }, task)
}

/// The time without a usable connection after which calls that wait for one fail, unless a [`Task`] is given another: 20 s.
pub const GIVE_UP_AFTER: Duration = Duration::from_secs(20);

/// Owns a session and its connections, one after the other. It ends with [`Handle::shutdown`], or with the last handle.
/// Nothing happens before it is run.
#[must_use = "calls wait until the task is run"]
pub struct Task<S: Service, C> {
    served: ServedSession<S>,
    unrun: Ends<S>,
    connector: C,
    stop: watch::Receiver<Option<Duration>>,
    waker: Waker,
    reconnect: Reconnect,
    connect_pause: Duration,
    stall: Duration,
    give_up_after: Duration,
}

/// Ends the calls of a task that is dropped before it runs.
struct Ends<S: Service>(Arc<Shared<S>>);

impl<S: Service> Drop for Ends<S> {
    fn drop(&mut self) {
        drop(self.0.take_unrun());
    }
}

/// The delays of a [`Task`] before it reconnects: doubled after each attempt, and half of it random, so that many tasks that
/// lost the same peer do not reconnect at once. After a connection that lasted longer than the last pause it restarts,
/// unless the peer has sent nothing and the connection was [given up](Handle::reconnect) or unusable for the link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Reconnect {
    /// The delay after the first attempt. Default: 100 ms.
    pub first: Duration,
    /// The longest delay. Default: 5 s.
    pub longest: Duration,
}

impl Default for Reconnect {
    fn default() -> Self {
        Self { first: Duration::from_millis(100), longest: Duration::from_secs(5) }
    }
}

/// Makes a new connection, and waits for the pause.
async fn connect<C: Connector>(connector: &mut C, pause: Duration) -> io::Result<C::Transport> {
    let transport = connector.connect().await?;
    if !pause.is_zero() {
        sleep(pause).await;
    }
    Ok(transport)
}

impl<S: Service, C: Connector> Task<S, C> {
    /// Sets the delays before it reconnects.
    pub fn reconnect(self, reconnect: Reconnect) -> Self {
        Self { reconnect, ..self }
    }

    /// Sets the pause between each new connection and the first byte that is sent on it, for devices that lose bytes that
    /// arrive sooner. Default: zero. Calls that are made in this time wait for its end.
    pub fn connect_pause(self, pause: Duration) -> Self {
        Self { connect_pause: pause, ..self }
    }

    /// Sets the time for which the peer may read nothing, and storing the state may take, in place of [`STALL`]. After this
    /// time the connection ends.
    pub fn stall(self, stall: Duration) -> Self {
        Self { stall, ..self }
    }

    /// Sets the time without a usable connection after which calls that wait for one fail, in place of [`GIVE_UP_AFTER`];
    /// [`Duration::MAX`]: never. A connection is usable if bytes were sent on it, unless the service then found the peer
    /// silent or wrong within that time. The time begins when the task runs, when a usable connection is lost, and each time
    /// that calls have failed in this way.
    pub fn give_up_after(self, time: Duration) -> Self {
        Self { give_up_after: time, ..self }
    }

    /// Runs the task; returns the session.
    pub async fn run(self) -> Box<S::Session> {
        let Self { served, unrun, mut connector, stop, waker, .. } = self;
        let Self { reconnect, connect_pause, stall, give_up_after, .. } = self;
        let shared = Arc::clone(&unrun.0);
        let Some(TaskChannels { calls, link }) = shared.take_unrun() else { return served.session };
        // When this future is dropped, all calls end before the link does.
        let mut served = served;
        let mut inbox = Inbox { calls, stop, waker, shared };
        let mut outage = Outage::new(give_up_after);
        let Reconnect { first, longest } = reconnect;
        let mut pause = first;
        if let Some(after) = served.session.discards_after() {
            connector.discard_after(after);
        }
        loop {
            let connecting = connect(&mut connector, connect_pause);
            let Some(connected) = served.meanwhile(&mut inbox, &mut outage, connecting).await else {
                break;
            };
            let has_connected = connected.is_ok();
            let error = match connected {
                Ok(transport) => {
                    let begun = Instant::now();
                    let span = Span::of([S::Session::LINK, S::Session::END], connector.peer().as_deref());
                    let transport = Box::new(transport);
                    let mut connection = Box::new(Connection::new(served, transport, stall, span.clone()));
                    span.within(|| connection.begin());
                    link.set(Link::Connected);
                    let (connection, over) =
                        span.instrument(serve(connection, &mut inbox, &mut connector)).await;
                    let lasted = begun.elapsed();
                    let is_unusable = matches!(over, ConnectionEnd::Unusable(_));
                    let soon_unusable = is_unusable && lasted < give_up_after;
                    if connection.has_sent && !soon_unusable {
                        outage = Outage::new(give_up_after);
                    }
                    let is_silent = is_unusable && !connection.has_received;
                    served = span.within(|| connection.end());
                    if lasted >= pause && !is_silent {
                        pause = first;
                    }
                    match over {
                        ConnectionEnd::Stopped => break,
                        ConnectionEnd::Replaced => continue,
                        ConnectionEnd::Lost(error) | ConnectionEnd::Unusable(error) => {
                            span.within(|| trace::failed("the connection is lost", &error));
                            error
                        }
                    }
                }
                Err(error) => {
                    let span = Span::of([S::Session::LINK, S::Session::END], connector.peer().as_deref());
                    span.within(|| trace::failed("no connection", &error));
                    error
                }
            };
            let error = Arc::new(error);
            link.set(Link::Failed(Arc::clone(&error)));
            if !has_connected {
                served.refuse_waiting(&mut inbox, &error);
            }
            outage.why = Some(error);
            if has_connected && !C::DIALS {
                continue;
            }
            let wait = sleep(pause.mul_f64(0.5 + fastrand::f64() / 2.0));
            if served.meanwhile(&mut inbox, &mut outage, wait).await.is_none() {
                break;
            }
            pause = pause.saturating_mul(2).min(longest);
        }
        let Inbox { mut calls, .. } = inbox;
        calls.close();
        let error = Arc::new(io::Error::other("the task of the session has ended"));
        while let Some(call) = calls.recv().await {
            served.service.refuse(call, &error);
        }
        let ServedSession { session, service, .. } = served;
        drop(service);
        session
    }

    /// Runs the task in a thread of its own: for programs without a runtime, whose calls any executor can wait for, such as
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
}

/// Serves one connection, from its beginning to its end.
async fn serve<S: Service>(
    mut connection: Box<Connection<S>>,
    inbox: &mut Inbox<S>,
    connector: &mut impl Connector,
) -> (Box<Connection<S>>, ConnectionEnd) {
    let Inbox { calls, stop, waker, shared } = inbox;
    let mut over = pin!(over(stop, connector));
    let mut woken = pin!(waker.0.notified());
    let _open = shared.open();
    loop {
        match connection.prepare() {
            Ok(false) => {}
            Ok(true) => {
                if let Err(over) = connection.keep(over.as_mut()).await {
                    return (connection, over);
                }
            }
            Err(error) => return (connection, ConnectionEnd::Unusable(error)),
        }
        let mut inputs = Inputs { over: over.as_mut(), calls, woken: woken.as_mut(), waker };
        let mut awake = Some(connection);
        let waited;
        (connection, waited) = poll_fn(|context| {
            let mut connection = match awake.take() {
                Some(connection) => connection,
                None => {
                    let Some(mut connection) = shared.take(context) else { return Poll::Pending };
                    if let Some(handed_over) = connection.wake_up() {
                        return Poll::Ready((connection, WaitResult::HandedOver(handed_over)));
                    }
                    connection
                }
            };
            if shared.is_finished() {
                return Poll::Ready((connection, WaitResult::Over(ConnectionEnd::Stopped)));
            }
            if let Some(why) = shared.take_unusable() {
                return Poll::Ready((connection, WaitResult::Over(ConnectionEnd::Unusable(why))));
            }
            match connection.poll(context, &mut inputs) {
                Poll::Ready(waited) => Poll::Ready((connection, waited)),
                Poll::Pending => {
                    shared.put(connection);
                    Poll::Pending
                }
            }
        })
        .await;
        if let ControlFlow::Break(over) = connection.take(waited) {
            return (connection, over);
        }
    }
}

/// The task's ends of the channels to the handles.
struct Inbox<S: Service> {
    calls: mpsc::Receiver<S::Call>,
    /// The time at which the task ends.
    stop: watch::Receiver<Option<Duration>>,
    waker: Waker,
    shared: Arc<Shared<S>>,
}

/// The time without a connection on which bytes were sent.
struct Outage {
    limit: Duration,
    /// The time at which waiting calls fail.
    until: Duration,
    /// The last failure.
    why: Option<Arc<io::Error>>,
}

impl Outage {
    /// Creates an outage that begins now.
    fn new(limit: Duration) -> Self {
        let limit = limit.max(MIN_FAIL_INTERVAL);
        Self { limit, until: now().saturating_add(limit), why: None }
    }

    /// Returns the reason that waiting calls fail, if they do; the next calls then have the full time.
    fn ends(&mut self) -> Option<Arc<io::Error>> {
        if !is_due(self.until, now()) {
            return None;
        }
        self.until = now().saturating_add(self.limit);
        let nobody = || Arc::new(io::Error::new(io::ErrorKind::TimedOut, "there is no peer"));
        Some(self.why.clone().unwrap_or_else(nobody))
    }
}

impl<S: Service> ServedSession<S> {
    /// Refuses the calls that wait for a connection. Returns whether there were any.
    fn refuse_waiting(&mut self, inbox: &mut Inbox<S>, why: &Arc<io::Error>) -> bool {
        let mut has_refused = false;
        while !S::OFFLINE
            && let Ok(call) = inbox.calls.try_recv()
        {
            self.service.refuse(call, why);
            has_refused = true;
        }
        has_refused
    }

    /// Waits without a connection, during which the session meets its deadlines. `None` if the task must end.
    async fn meanwhile<T>(
        &mut self,
        inbox: &mut Inbox<S>,
        outage: &mut Outage,
        wait: impl Future<Output = T>,
    ) -> Option<T> {
        let mut wait = pin!(wait);
        let stop = inbox.stop.clone();
        let mut stopped = pin!(stopped(stop));
        loop {
            if let Some(why) = outage.ends() {
                if self.refuse_waiting(inbox, &why) {
                    // Callers that found the channel full can make their calls now: they fail too.
                    outage.until = now().saturating_add(MIN_FAIL_INTERVAL);
                }
                let Self { session, service, events, reconnect, .. } = &mut *self;
                service.give_up(session, &why, &mut Reports { events, reconnect });
                self.report();
            }
            let due = self.session.poll_timeout().map(|at| at.max(now().saturating_add(MIN_CALL_INTERVAL)));
            let time = until(due.into_iter().chain([outage.until]).min());
            let takes_calls = S::OFFLINE && self.has_room();
            let Inbox { calls, waker, shared, .. } = &mut *inbox;
            let (mut time, mut woken) = (pin!(time), pin!(waker.woken()));
            let awake = poll_fn(|context| {
                if stopped.as_mut().poll(context).is_ready() || shared.is_finished() {
                    return Poll::Ready(WakeCause::Stopped);
                }
                if let Poll::Ready(value) = wait.as_mut().poll(context) {
                    return Poll::Ready(WakeCause::Value(value));
                }
                if takes_calls && let Poll::Ready(call) = calls.poll_recv(context) {
                    return Poll::Ready(call.map_or(WakeCause::Stopped, WakeCause::Call));
                }
                if woken.as_mut().poll(context).is_ready() || time.as_mut().poll(context).is_ready() {
                    return Poll::Ready(WakeCause::Due);
                }
                Poll::Pending
            });
            match awake.await {
                WakeCause::Stopped => return None,
                WakeCause::Value(value) => return Some(value),
                WakeCause::Call(call) => self.call(call),
                WakeCause::Due => {}
            }
            self.session.handle_timeout(now());
            self.report();
        }
    }
}

/// The event that has ended a wait without a connection.
enum WakeCause<T, C> {
    Stopped,
    Value(T),
    Call(C),
    Due,
}

async fn until(at: Option<Duration>) {
    match at {
        None | Some(Duration::MAX) => pending().await,
        Some(at) => sleep(at.saturating_sub(now())).await,
    }
}

/// Waits for the end of the task, or for a connection that replaces this one.
async fn over(stop: &watch::Receiver<Option<Duration>>, connector: &mut impl Connector) -> ConnectionEnd {
    let stopped = async {
        stopped(stop.clone()).await;
        ConnectionEnd::Stopped
    };
    let replaced = async {
        connector.replaced().await;
        ConnectionEnd::Replaced
    };
    first(stopped, replaced).await
}

/// Waits for two futures; returns the value of the future that is ready first, or of `one` if both are ready.
async fn first<T>(one: impl Future<Output = T>, other: impl Future<Output = T>) -> T {
    let (mut one, mut other) = (pin!(one), pin!(other));
    poll_fn(|context| match one.as_mut().poll(context) {
        Poll::Ready(value) => Poll::Ready(value),
        Poll::Pending => other.as_mut().poll(context),
    })
    .await
}

/// Waits for the time at which the task is to end, or until the last handle is dropped.
async fn stopped(mut stop: watch::Receiver<Option<Duration>>) {
    loop {
        let at = *stop.borrow_and_update();
        let over = async {
            until(at).await;
            true
        };
        if first(async { stop.changed().await.is_err() }, over).await {
            return;
        }
    }
}

impl<S: Service, C> fmt::Debug for Task<S, C> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Task").field("reconnect", &self.reconnect).finish_non_exhaustive()
    }
}
