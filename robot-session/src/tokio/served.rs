//! A session in a task, with its service.

use core::ops::ControlFlow;
use core::time::Duration;
use std::boxed::Box;
use std::io;

use ::tokio::sync::broadcast;

use super::service::{Reports, Service};
use crate::pending::PendingWork;
use crate::{Session as _, now};

/// A session, its service, and the channel of its events.
pub(super) struct ServedSession<S: Service> {
    /// Boxed: the value that a task returns is moved whenever the task is polled.
    pub(super) session: Box<S::Session>,
    pub(super) service: S,
    pub(super) events: broadcast::Sender<S::Event>,
    /// The reason that the connection is unusable.
    pub(super) reconnect: Option<io::Error>,
    /// Whether the service has got events since its state was stored.
    pub(super) has_reported: bool,
}

impl<S: Service> ServedSession<S> {
    pub(super) fn has_room(&self) -> bool {
        self.service.has_room(&self.session)
    }

    /// Reports events before a wait, and puts the bytes to be sent into `out`.
    pub(super) fn prepare(
        &mut self,
        unsent: &mut PendingWork,
        out: &mut [u8],
        now: Duration,
    ) -> io::Result<()> {
        let Self { session, service, events, reconnect, has_reported } = self;
        let each = |session: &mut S::Session, event| {
            *has_reported = true;
            service.event(session, event, &mut Reports { events, reconnect });
            reconnect.take().map_or(ControlFlow::Continue(()), ControlFlow::Break)
        };
        match unsent.prepare(&mut **session, out, now, each) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(error) => Err(error),
        }
    }

    /// Returns the latest time at which session or service are to be called.
    pub(super) fn due(&self, unsent: &PendingWork, now: Duration) -> Option<Duration> {
        unsent.due(&*self.session, now).into_iter().chain(self.service.poll_timeout()).min()
    }

    pub(super) fn call(&mut self, call: S::Call) {
        self.service.call(&mut self.session, now(), call);
    }

    /// Reports every event, if there is no connection that the events could end.
    pub(super) fn report(&mut self) {
        let Self { session, service, events, reconnect, .. } = self;
        while let Some(event) = session.poll_event() {
            service.event(session, event, &mut Reports { events, reconnect });
        }
        self.reconnect = None;
    }
}
