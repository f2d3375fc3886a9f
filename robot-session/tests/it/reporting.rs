//! A service without calls.

use core::marker::PhantomData;
use core::time::Duration;
use std::io;
use std::sync::Arc;

use robot_session::Session;
use robot_session::tokio::{Reports, Service};

/// Reports every event.
pub(crate) struct Reporting<S>(PhantomData<S>);

impl<S> Reporting<S> {
    pub(crate) const NEW: Self = Self(PhantomData);
}

impl<S: Session<Event: Clone + Send> + Send> Service for Reporting<S> {
    type Session = S;
    type Call = ();
    type Event = S::Event;

    fn call(&mut self, _: &mut S, _: Duration, (): ()) {}

    fn event(&mut self, _: &mut S, event: S::Event, reports: &mut Reports<'_, S::Event>) {
        reports.event(event);
    }

    fn refuse(&mut self, (): (), _: &Arc<io::Error>) {}
}
