//! What a simulated device is, below its faults and what carries its bytes.

use core::error::Error as StdError;
use core::fmt::Debug;
use core::time::Duration;
use std::collections::VecDeque;
use std::io;

use robot_session::Session;

/// A device around its session: what it does about the session's events, and what goes on in it by itself.
pub trait Device {
    /// Its end of the link.
    type Session: Session;
    /// What it tells of itself.
    type Event: Clone + Debug + Send + 'static;
    /// What it executes.
    type Work: Clone + Debug + Send + 'static;
    /// Whether it connects to its peer, when its [`Notes::connect`] says so; else its peer connects to it.
    const IS_CLIENT: bool = false;

    /// Its end of the link.
    fn session(&self) -> &Self::Session;

    /// The same, to call it.
    fn session_mut(&mut self) -> &mut Self::Session;

    /// Acts on an event of the session.
    fn take(
        &mut self,
        now: Duration,
        event: <Self::Session as Session>::Event,
        notes: &mut Notes<Self::Event, Self::Work>,
    );

    /// Moves on to this time.
    fn advance(&mut self, now: Duration, notes: &mut Notes<Self::Event, Self::Work>);

    /// When [`advance`](Self::advance) is to be called at the latest.
    fn due(&self) -> Option<Duration>;

    /// Its power was lost: it restarts without a connection, and keeps what a real device keeps.
    fn restart(&mut self, now: Duration);

    /// It loses what it holds and has not executed; the connection goes on.
    fn forget(&mut self, now: Duration);

    /// The peer of a connection in TLS has shown this certificate (DER), which is verified. Called before the first bytes of the peer.
    fn secured(&mut self, _certificate: &[u8]) {}

    /// The same device on one more connection at the same time; `None` where a new connection takes the place of the one before.
    fn another(&self) -> Option<Self>
    where
        Self: Sized,
    {
        None
    }
}

/// What was executed, and when it was over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Executed<W> {
    /// Since the device was first used.
    pub at: Duration,
    /// What.
    pub work: W,
}

/// Where a device notes what it does.
#[derive(Debug)]
pub struct Notes<E, W> {
    pub(crate) events: VecDeque<E>,
    pub(crate) executed: VecDeque<Executed<W>>,
    pub(crate) close: Option<&'static str>,
    pub(crate) connect: bool,
}

impl<E, W> Default for Notes<E, W> {
    fn default() -> Self {
        Self { events: VecDeque::new(), executed: VecDeque::new(), close: None, connect: false }
    }
}

impl<E, W> Notes<E, W> {
    /// Something has happened.
    pub fn event(&mut self, event: E) {
        self.events.push_back(event);
    }

    /// Something was executed at this time.
    pub fn executed(&mut self, at: Duration, work: W) {
        self.executed.push_back(Executed { at, work });
    }

    /// The connection is to be closed once everything is sent, and why.
    pub fn close(&mut self, why: &'static str) {
        self.close.get_or_insert(why);
    }

    /// The device, which is a client, is to be connected.
    pub fn connect(&mut self) {
        self.connect = true;
    }
}

/// Why there is no device.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// These settings cannot work.
    #[error("{0}")]
    Settings(#[source] Box<dyn StdError + Send + Sync>),
    /// The system's.
    #[error(transparent)]
    Io(#[from] io::Error),
}

impl Error {
    /// Settings that cannot work.
    pub fn settings(why: impl Into<Box<dyn StdError + Send + Sync>>) -> Self {
        Self::Settings(why.into())
    }
}
