//! A simulated device, without its faults and its transport.

use core::error::Error as StdError;
use core::fmt::Debug;
use core::time::Duration;
use std::collections::VecDeque;
use std::io;

use robot_session::Session;

/// A device around its session: its reactions to the session's events, and its own processes.
pub trait Device {
    /// The session of the device's end.
    type Session: Session;
    /// An event of the device.
    type Event: Clone + Debug + Send + 'static;
    /// A unit of work that the device executes.
    type Work: Clone + Debug + Send + 'static;
    /// Whether it connects to its peer, when it calls [`DeviceRecord::connect`]; otherwise its peer connects to it.
    const IS_CLIENT: bool = false;

    /// Returns the session of the device's end.
    fn session(&self) -> &Self::Session;

    /// Returns the session as a mutable reference, to call it.
    fn session_mut(&mut self) -> &mut Self::Session;

    /// Acts on an event of the session.
    fn take(
        &mut self,
        now: Duration,
        event: <Self::Session as Session>::Event,
        notes: &mut DeviceRecord<Self::Event, Self::Work>,
    );

    /// Moves on to this time.
    fn advance(&mut self, now: Duration, notes: &mut DeviceRecord<Self::Event, Self::Work>);

    /// Returns the latest time of the next call of [`advance`](Self::advance).
    fn due(&self) -> Option<Duration>;

    /// Restarts the device after a loss of power: it has no connection, and retains the state that a real device retains.
    fn restart(&mut self, now: Duration);

    /// Drops the device's unexecuted work; the connection continues.
    fn forget(&mut self, now: Duration);

    /// Called when the peer of a TLS connection has shown this certificate (DER), which is verified, and before the first
    /// bytes of the peer.
    fn secured(&mut self, _certificate: &[u8]) {}

    /// Returns the same device for one more simultaneous connection; `None` if a new connection replaces the previous
    /// one.
    fn another(&self) -> Option<Self>
    where
        Self: Sized,
    {
        None
    }
}

/// A unit of executed work, with the time at which it ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ExecutedWork<W> {
    /// The time since the device was first used.
    pub at: Duration,
    /// The job, instruction or motion that was executed.
    pub work: W,
}

/// The record of a device's events and work.
#[derive(Debug)]
pub struct DeviceRecord<E, W> {
    pub(crate) events: VecDeque<E>,
    pub(crate) executed: VecDeque<ExecutedWork<W>>,
    pub(crate) close: Option<&'static str>,
    pub(crate) connect: bool,
}

impl<E, W> Default for DeviceRecord<E, W> {
    fn default() -> Self {
        Self { events: VecDeque::new(), executed: VecDeque::new(), close: None, connect: false }
    }
}

impl<E, W> DeviceRecord<E, W> {
    /// Reports an event.
    pub fn event(&mut self, event: E) {
        self.events.push_back(event);
    }

    /// Reports that work was executed at this time.
    pub fn executed(&mut self, at: Duration, work: W) {
        self.executed.push_back(ExecutedWork { at, work });
    }

    /// Requests that the connection be closed once everything is sent, for the reason `why`.
    pub fn close(&mut self, why: &'static str) {
        self.close.get_or_insert(why);
    }

    /// Requests that the device, which is a client, be connected.
    pub fn connect(&mut self) {
        self.connect = true;
    }
}

/// The reason that a device cannot be created.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The settings cannot work together.
    #[error("{0}")]
    Settings(#[source] Box<dyn StdError + Send + Sync>),
    /// The system has refused a transport or a file.
    #[error(transparent)]
    Io(#[from] io::Error),
}

impl Error {
    /// Settings that cannot work.
    pub fn settings(why: impl Into<Box<dyn StdError + Send + Sync>>) -> Self {
        Self::Settings(why.into())
    }
}
