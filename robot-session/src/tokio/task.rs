//! A session in a task of its own.

use core::fmt;
use core::future::{Future, pending};
use core::ops::ControlFlow;
use core::pin::pin;
use core::time::Duration;
use std::boxed::Box;
use std::io;
use std::sync::Arc;
use std::thread::{Builder, JoinHandle};

use ::tokio::select;
use ::tokio::sync::{broadcast, mpsc, watch};
use ::tokio::time::{Instant, sleep};

use super::{Connector, Driver, Handle, Link, Reports, Service, Waker};
use crate::turn::Handler;
use crate::{Ended, STALL, Session, now};

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
    let served = Served { session: Box::new(session), service, events: events_of_task, reconnect: None };
    let task = Task {
        served,
        connector,
        calls: calls_of_task,
        link: link_of_task,
        stop: stop_of_task,
        waker: waker.clone(),
        reconnect: Reconnect::default(),
        stall: STALL,
    };
    (Handle { calls, events, link, stop: Arc::new(stop), waker }, task)
}

/// Owns a session and its connections, one after the other. It ends with [`Handle::shutdown`], and with the last handle.
pub struct Task<S: Service, C> {
    served: Served<S>,
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
enum Over {
    /// The task is to end.
    Stopped,
    /// Another one replaces it.
    Replaced,
    Lost(io::Error),
}

/// A session, and who gets its events.
struct Served<S: Service> {
    /// Boxed: what a task returns is moved whenever it is polled.
    session: Box<S::Session>,
    service: S,
    events: broadcast::Sender<S::Event>,
    /// Why the connection is unusable.
    reconnect: Option<io::Error>,
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
        if let Some(after) = self.served.session.discards_after() {
            self.connector.discard_after(after);
        }
        loop {
            let Self { served, connector, calls, stop, waker, .. } = &mut self;
            let Some(connected) = served.meanwhile(stop, waker, calls, connector.connect()).await else {
                break;
            };
            let has_connected = connected.is_ok();
            let error = match connected {
                Ok(transport) => {
                    let begun = Instant::now();
                    let over = self.serve(transport).await;
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
                self.served.service.refuse(call, &error);
            }
            if has_connected && !C::DIALS {
                continue;
            }
            let wait = sleep(pause.mul_f64(0.5 + fastrand::f64() / 2.0));
            let Self { served, calls, stop, waker, .. } = &mut self;
            if served.meanwhile(stop, waker, calls, wait).await.is_none() {
                break;
            }
            pause = pause.saturating_mul(2).min(longest);
        }
        self.calls.close();
        let error = Arc::new(io::Error::other("the task of the session has ended"));
        while let Some(call) = self.calls.recv().await {
            self.served.service.refuse(call, &error);
        }
        self.served.session
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
    async fn serve(&mut self, transport: C::Transport) -> Over {
        let Self { served, connector, calls, link, stop, waker, stall, .. } = self;
        let mut driver = Driver::woken_by(waker.clone(), transport).stall(*stall);
        let mut stopped = pin!(stopped(stop));
        served.session.handle_connected(now());
        link.send_replace(Link::Connected);
        let over = loop {
            let has_room = served.has_room();
            let woken = {
                let Served { session, service, events, reconnect } = &mut *served;
                let time = until(service.poll_timeout());
                let told = Told { service, events, reconnect };
                // A turn that a call interrupts loses nothing.
                select! {
                    biased;
                    () = &mut stopped => break Over::Stopped,
                    () = connector.replaced() => break Over::Replaced,
                    call = calls.recv(), if has_room => Woken::Call(call),
                    turn = driver.turn_of(&mut **session, told) => Woken::Turn(turn),
                    () = time => Woken::Time,
                }
            };
            match woken {
                Woken::Time => served.service.handle_timeout(&mut served.session, now()),
                Woken::Turn(Ok(ControlFlow::Continue(()))) => {
                    if let Err(error) = served.service.keep(&mut served.session).await {
                        break Over::Lost(error);
                    }
                }
                Woken::Turn(Ok(ControlFlow::Break(Ended::ByHandler(error))) | Err(error)) => {
                    break Over::Lost(error);
                }
                Woken::Turn(Ok(ControlFlow::Break(Ended::Stalled))) => {
                    let stalled = "the peer does not read";
                    break Over::Lost(io::Error::new(io::ErrorKind::TimedOut, stalled));
                }
                Woken::Turn(Ok(ControlFlow::Break(Ended::ByPeer))) => {
                    let closed = "the peer has closed the connection";
                    break Over::Lost(io::Error::new(io::ErrorKind::UnexpectedEof, closed));
                }
                Woken::Call(None) => break Over::Stopped,
                Woken::Call(Some(call)) => {
                    served.call(call);
                    while served.has_room()
                        && let Ok(call) = calls.try_recv()
                    {
                        served.call(call);
                    }
                }
            }
        };
        served.session.handle_disconnected(now());
        served.report();
        over
    }
}

impl<S: Service> Served<S> {
    fn has_room(&self) -> bool {
        self.service.has_room(&self.session)
    }

    fn call(&mut self, call: S::Call) {
        self.service.call(&mut self.session, now(), call);
    }

    /// Every event, where there is no connection that it could end.
    fn report(&mut self) {
        let Self { session, service, events, reconnect } = self;
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

/// The service of a session that has a connection.
struct Told<'a, S: Service> {
    service: &'a mut S,
    events: &'a broadcast::Sender<S::Event>,
    reconnect: &'a mut Option<io::Error>,
}

impl<S: Service> Handler<S::Session, io::Error> for Told<'_, S> {
    type Break = io::Error;

    fn event(
        &mut self,
        session: &mut S::Session,
        event: <S::Session as Session>::Event,
    ) -> ControlFlow<io::Error> {
        let Self { service, events, reconnect } = self;
        service.event(session, event, &mut Reports { events, reconnect });
        reconnect.take().map_or(ControlFlow::Continue(()), ControlFlow::Break)
    }

    fn before_write(&mut self, session: &mut S::Session) -> impl Future<Output = io::Result<()>> {
        self.service.keep(session)
    }
}

/// What a wait has brought.
enum Woken<T, C> {
    Turn(T),
    Call(Option<C>),
    Time,
}

async fn until(at: Option<Duration>) {
    match at {
        None | Some(Duration::MAX) => pending().await,
        Some(at) => sleep(at.saturating_sub(now())).await,
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
