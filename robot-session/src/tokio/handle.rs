//! The handle of a session whose task owns the session.

use core::fmt::{self, Debug};
use core::future::Future;
use core::pin::Pin;
use core::task::{Context, Poll};
use core::time::Duration;
use std::io;
use std::sync::Arc;

use ::tokio::sync::{broadcast, mpsc, oneshot, watch};

use super::shared::{Link, Shared};
use super::{Service, Waker};
use crate::{Session as _, now, trace};

/// The receiver of a call's outcome.
pub struct Reply<T> {
    outcome: oneshot::Sender<T>,
    /// Counts the call as one in progress.
    _in_progress: Arc<()>,
    trace: trace::Call,
}

impl<T: Debug> Reply<T> {
    /// Ends the call.
    ///
    /// # Errors
    /// The call is no longer awaited: the outcome is returned.
    pub fn send(self, outcome: T) -> Result<(), T> {
        self.trace.ended(&outcome);
        self.outcome.send(outcome)
    }

    /// Returns whether the call is no longer awaited.
    pub fn is_abandoned(&self) -> bool {
        self.outcome.is_closed()
    }
}

impl<T> Debug for Reply<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Reply")
    }
}

/// The outcome of a call, when there is one.
#[derive(Debug)]
#[must_use = "a call whose outcome is not awaited is abandoned"]
pub struct Outcome<T>(oneshot::Receiver<T>);

impl<T> Future for Outcome<T> {
    type Output = Result<T, Closed>;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        Pin::new(&mut self.0).poll(context).map_err(|_| Closed)
    }
}

/// The caller's side of a session: calls, events, the state of the connection, and shutdown. Cloning it is cheap; the
/// [`Task`](super::Task) ends when the last one is dropped.
///
/// # Every call ends
/// While its task runs, a call has an outcome in a bounded time, regardless of the peer:
/// - While there is a connection, the session's own times apply: those of its configuration. Calls that must wait for others
///   wait for their outcomes. An order or a motion takes as long as the peer reports that it continues.
/// - Without a connection, a call waits for the current attempt to connect, and fails with it.
/// - When a connection is lost, the outcome of a call that was sent is unknown, unless its session can continue it on the
///   next connection. A call that was not sent waits for the next one.
/// - No call waits longer than [`Task::give_up_after`](super::Task::give_up_after) for a usable connection. A connection is
///   not usable if its peer closes it at once, or while the state cannot be stored.
///
/// # Dropped futures
/// A call whose future is dropped while the call waits is withdrawn: no part of it is sent. Once the session has accepted a
/// call, the call continues, and its outcome is one of the [`events`](Self::events). A call that stops a motion, ends an
/// order or clears a queue is made in any case. The documentation of other calls states any difference.
///
/// # Connection and events
/// ```
/// # use core::fmt::Debug;
/// use robot_session::tokio::{Handle, Service};
/// use tokio::sync::broadcast::error::RecvError;
///
/// /// Prints each change of the connection and each event until the task ends.
/// async fn print<S: Service<Event: Debug>>(handle: &Handle<S>) {
///     let (mut link, mut events) = (handle.link(), handle.events());
///     loop {
///         tokio::select! {
///             Ok(()) = link.changed() => println!("{:?}", *link.borrow_and_update()),
///             event = events.recv() => match event {
///                 Ok(event) => println!("{event:?}"),
///                 Err(RecvError::Lagged(lost)) => println!("{lost} events are lost: they were not read in time"),
///                 Err(RecvError::Closed) => break,
///             },
///         }
///     }
/// }
/// ```
pub struct Handle<S: Service> {
    pub(super) calls: mpsc::Sender<S::Call>,
    pub(super) events: broadcast::Receiver<S::Event>,
    pub(super) link: watch::Receiver<Link>,
    pub(super) stop: Arc<watch::Sender<Option<Duration>>>,
    pub(super) waker: Waker,
    pub(super) shared: Arc<Shared<S>>,
}

/// The task of the session has ended, or is ending: it was shut down, its future was dropped, or it has panicked. A call that
/// ends so was not made, or its outcome is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Closed;

impl<S: Service> Handle<S> {
    /// Makes a call and waits for its outcome: `call` gets the receiver of that. The session limits the number of calls in
    /// progress; others wait, the oldest first. Without a connection they wait for the current attempt, and fail with it.
    ///
    /// [What a dropped future withdraws](Self#dropped-futures).
    ///
    /// # Errors
    /// The task has ended.
    pub async fn call<T>(&self, call: impl FnOnce(Reply<T>) -> S::Call) -> Result<T, Closed> {
        self.begin(call).await?.await
    }

    /// Makes a call; its outcome is awaited separately.
    ///
    /// # Errors
    /// The task has ended.
    pub async fn begin<T>(&self, call: impl FnOnce(Reply<T>) -> S::Call) -> Result<Outcome<T>, Closed> {
        if self.shared.is_ending() {
            return Err(Closed);
        }
        let (reply, outcome) = oneshot::channel();
        let trace = trace::Call::of([S::Session::LINK, S::Session::END]);
        let record = trace.clone();
        let call = call(Reply { outcome: reply, _in_progress: self.shared.begin_call(), trace });
        record.begun(&call);
        // While the task sleeps, the caller makes the call itself: waking the task for it costs as much as the call.
        let call = match self.shared.borrow(&self.calls) {
            Some(mut connection) => match connection.call(call) {
                Ok(()) => return Ok(Outcome(outcome)),
                Err(call) => call,
            },
            None => call,
        };
        let permit = match self.calls.try_reserve() {
            Ok(permit) => permit,
            Err(mpsc::error::TrySendError::Full(())) => self.calls.reserve().await.map_err(|_| Closed)?,
            Err(mpsc::error::TrySendError::Closed(())) => return Err(Closed),
        };
        permit.send(call);
        Ok(Outcome(outcome))
    }

    /// Makes a call without awaiting its outcome, if it fits the channel now; returns whether it does.
    pub fn try_call(&self, call: S::Call) -> bool {
        !self.shared.is_ending() && self.calls.try_send(call).is_ok()
    }

    /// Returns the events from now on. A slow reader loses the oldest ones, and gets their number.
    pub fn events(&self) -> broadcast::Receiver<S::Event> {
        self.events.resubscribe()
    }

    /// Returns the state of the connection, and every change of it: [`Link::Connecting`] until the first attempt has an
    /// outcome, [`Link::Connected`], [`Link::Failed`] with the reason while further attempts follow, and [`Link::Ended`] with
    /// the task.
    pub fn link(&self) -> watch::Receiver<Link> {
        self.link.clone()
    }

    /// Waits for a connection.
    ///
    /// # Errors
    /// The task has ended.
    pub async fn connected(&self) -> Result<(), Closed> {
        let mut link = self.link.clone();
        link.wait_for(|link| matches!(link, Link::Connected)).await.map_err(|_| Closed)?;
        Ok(())
    }

    /// Gives up the connection, if there is one: the task makes another one after a pause, as for a lost connection. For a
    /// caller that can detect, unlike the session, that the connection is of no use, for example because the peer has been
    /// silent for too long.
    pub fn reconnect(&self, why: io::Error) {
        self.shared.give_up(why);
        self.waker.wake();
    }

    /// Ends the connection and the task, and waits for that. Calls in progress have then ended, with the outcomes of a lost
    /// connection. If the state is being stored, the task waits for that for a second at most. A task that does not run yet
    /// ends when it is run.
    pub async fn shutdown(&self) {
        self.end_at(Duration::ZERO).await;
    }

    /// Refuses new calls, waits until those in progress have ended, but no longer than `time`, then ends as
    /// [`shutdown`](Self::shutdown) does. Calls that are still in progress then have the outcomes of a lost connection.
    /// Dropping the future does not stop this.
    pub async fn shutdown_after(&self, time: Duration) {
        self.end_at(now().saturating_add(time)).await;
    }

    async fn end_at(&self, at: Duration) {
        self.shared.end();
        drop(self.shared.take_unrun());
        self.stop.send_modify(|stop| *stop = Some(stop.map_or(at, |stop| stop.min(at))));
        let mut link = self.link.clone();
        while link.changed().await.is_ok() {}
    }

    /// Returns a waker, which makes the session check its inputs other than bytes and time, such as the queue between a
    /// robot's session and its motion task.
    pub fn waker(&self) -> Waker {
        self.waker.clone()
    }
}

impl<S: Service> Clone for Handle<S> {
    fn clone(&self) -> Self {
        Self {
            calls: self.calls.clone(),
            events: self.events.resubscribe(),
            link: self.link.clone(),
            stop: self.stop.clone(),
            waker: self.waker.clone(),
            shared: Arc::clone(&self.shared),
        }
    }
}

impl<S: Service> fmt::Debug for Handle<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Handle").field("link", &*self.link.borrow()).finish_non_exhaustive()
    }
}

impl fmt::Display for Closed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the task of the session has ended")
    }
}

impl core::error::Error for Closed {}
