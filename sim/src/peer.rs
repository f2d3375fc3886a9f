//! The other end of a link that no device here speaks.

use core::fmt::Debug;
use core::time::Duration;

use robot_session::Session;

use crate::device::{Device, DeviceRecord, Error};
use crate::settings::Settings;

/// Any session as a device: for a link of your own, or an end that is not among the devices. The session's events are
/// both its events and its "executed" work.
#[derive(Debug, Clone)]
pub struct Peer<S>(pub S);

impl<S> Settings for Peer<S>
where
    S: Session<Event: Clone + Debug + Send + 'static> + Clone,
{
    type Device = End<S>;

    fn device(&self) -> Result<End<S>, Error> {
        Ok(End { new: self.0.clone(), session: self.0.clone() })
    }
}

/// A [`Peer`] that is switched on.
#[derive(Debug)]
pub struct End<S> {
    new: S,
    session: S,
}

impl<S> Device for End<S>
where
    S: Session<Event: Clone + Debug + Send + 'static> + Clone,
{
    type Session = S;
    type Event = S::Event;
    type Work = S::Event;

    fn session(&self) -> &S {
        &self.session
    }

    fn session_mut(&mut self) -> &mut S {
        &mut self.session
    }

    fn take(&mut self, now: Duration, event: S::Event, notes: &mut DeviceRecord<S::Event, S::Event>) {
        notes.executed(now, event.clone());
        notes.event(event);
    }

    fn advance(&mut self, _: Duration, _: &mut DeviceRecord<S::Event, S::Event>) {}

    fn due(&self) -> Option<Duration> {
        None
    }

    fn restart(&mut self, _: Duration) {
        self.session = self.new.clone();
    }

    /// Does nothing: the peer's contents are unknown here.
    fn forget(&mut self, _: Duration) {}
}
