//! The part of a handle that a link adds to its session.

use core::fmt::Debug;
use core::future::{Future, ready};
use core::time::Duration;
use std::io;
use std::sync::Arc;

use ::tokio::sync::broadcast;

use crate::Session;

/// The part of a link for handles: its calls, and the matching of outcomes to calls.
///
/// While the task sleeps, a caller makes its call itself, so the methods run in any thread, one at a time. If one of them
/// panics, the task panics.
pub trait Service: Send {
    /// The session that receives the calls.
    type Session: Session + Send;
    /// One call: its arguments, and the receiver of its outcome.
    type Call: Debug + Send;
    /// The items of [`Handle::events`](super::Handle::events): all events except outcomes of awaited calls.
    type Event: Clone + Send;

    /// Whether calls are also made without a connection: those of a robot concern the robot itself.
    const OFFLINE: bool = false;

    /// Returns whether the session accepts another call now: always true by default. Otherwise calls wait, the oldest first.
    fn has_room(&self, _session: &Self::Session) -> bool {
        true
    }

    /// Makes a call, unless its caller is gone: then the call has no effect.
    fn call(&mut self, session: &mut Self::Session, now: Duration, call: Self::Call);

    /// Passes an event to its receiver. The outcome of a call that is no longer awaited is an event of the handle.
    fn event(
        &mut self,
        session: &mut Self::Session,
        event: <Self::Session as Session>::Event,
        reports: &mut Reports<'_, Self::Event>,
    );

    /// Returns the latest time at which [`handle_timeout`](Self::handle_timeout) is to be called, by the clock of
    /// [`now`](crate::now).
    fn poll_timeout(&self) -> Option<Duration> {
        None
    }

    /// Called when time has passed, before the session sends its messages.
    fn handle_timeout(&mut self, _session: &mut Self::Session, _now: Duration) {}

    /// Stores the state that must survive the program: called before bytes of the session are sent, so that the peer has
    /// nothing that was not stored, and after events. A dropped future is called again.
    ///
    /// # Errors
    /// The state could not be stored: nothing is sent, and the connection ends.
    fn keep(&mut self, _session: &mut Self::Session) -> impl Future<Output = io::Result<()>> + Send {
        ready(Ok(()))
    }

    /// Ends the calls that the session has accepted and not sent, as [`refuse`](Self::refuse) does, and withdraws them from
    /// the session: there was no usable connection for the time of [`Task::give_up_after`](super::Task::give_up_after). A
    /// service whose calls all end with their connection need not override it.
    fn give_up(
        &mut self,
        _session: &mut Self::Session,
        _why: &Arc<io::Error>,
        _reports: &mut Reports<'_, Self::Event>,
    ) {
    }

    /// Ends a call that was not made: there is no connection, or the task has ended.
    fn refuse(&mut self, call: Self::Call, why: &Arc<io::Error>);
}

/// The result of passing an event to a [`Service`].
#[derive(Debug)]
pub struct Reports<'a, E> {
    pub(super) events: &'a broadcast::Sender<E>,
    pub(super) reconnect: &'a mut Option<io::Error>,
}

impl<E: Clone> Reports<'_, E> {
    /// Reports an event to [`Handle::events`](super::Handle::events).
    pub fn event(&self, event: E) {
        // Without a receiver the event is dropped.
        let _ = self.events.send(event);
    }

    /// Reports that the connection is unusable: another one is made.
    pub fn reconnect(&mut self, why: io::Error) {
        self.reconnect.get_or_insert(why);
    }
}
