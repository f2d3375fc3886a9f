//! The loops that run a simulated device: one connection after the other, or many clients at once.

mod attend;
mod carrier;
#[cfg(feature = "tls")]
mod handshakes;
mod listener;
mod serve;

use core::time::Duration;
use std::io;

use robot_session::Session;

use crate::device::Device;
use crate::simulator::{Simulator, SimulatorReport};

pub use self::attend::{Change, Endpoint, State, attend};
pub use self::carrier::{Arrival, Carrier, refuse};
pub use self::listener::{Listener, probes};
pub use self::serve::Server;

/// The number of clients that a [`Server`] serves at once; others are refused.
pub const MAX_CLIENTS: usize = 1000;

/// A session that a host runs: a [`Simulator`], a session around one, or a PC of a Kawasaki robot.
pub trait HostedSession: Session + Sized {
    /// Returns the same device on one more connection; `None` if a new connection replaces the previous one.
    fn another(&self) -> Option<Self> {
        None
    }

    /// Called when the client has shown this certificate (DER) in TLS, which is verified, after
    /// [`handle_connected`](Session::handle_connected).
    fn secured(&mut self, _certificate: &[u8]) {}

    /// Returns whether a connection can be made now.
    fn accepts(&self, _now: Duration) -> bool {
        true
    }

    /// Returns whether the device does not read, so that the time of its transport passes only if the host advances it.
    fn is_held(&self) -> bool {
        false
    }

    /// Returns the request of an event to the host, if it has one.
    fn request(event: &Self::Event) -> Option<Request>;
}

/// A request of a device to its host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// The connection is to be closed, for this reason.
    Close(&'static str),
    /// The device is a client: a connection is to be made.
    Connect,
}

impl<D: Device> HostedSession for Simulator<D> {
    fn another(&self) -> Option<Self> {
        Simulator::another(self)
    }

    fn secured(&mut self, certificate: &[u8]) {
        self.device_mut().secured(certificate);
    }

    fn accepts(&self, now: Duration) -> bool {
        Simulator::accepts(self, now)
    }

    fn is_held(&self) -> bool {
        Simulator::is_held(self)
    }

    fn request(event: &SimulatorReport<D::Event>) -> Option<Request> {
        match event {
            SimulatorReport::Close(why) => Some(Request::Close(why)),
            SimulatorReport::Connect => Some(Request::Connect),
            SimulatorReport::Device(_) | SimulatorReport::Fault(_) => None,
        }
    }
}

/// A report of a host to its observer. The peer of a connection is named by its address; a line has no name for it.
#[derive(Debug)]
#[non_exhaustive]
pub enum Notice<'a, E> {
    /// A connection with this peer begins.
    Connected(&'a str),
    /// A client is not served, for this reason; its connection is closed.
    Refused(&'a str, &'a str),
    /// An event of the session.
    Event(&'a str, E),
    /// Bytes that have arrived, and their time. Reported by a [`Server`].
    Received(Duration, &'a [u8]),
    /// Bytes that are sent, and their time. Reported by a [`Server`].
    Sent(Duration, &'a [u8]),
    /// A connection has ended, or could not be made.
    Disconnected(&'a str, &'a ConnectionEnd),
    /// Bytes of the session are sent next: state that must survive the program is to be stored. Reported by [`attend`];
    /// after an error nothing is sent.
    Sending,
    /// The events of a turn have been reported: executed commands can be fetched.
    Settled,
}

/// The reason for which a connection has ended.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConnectionEnd {
    /// The device has closed it, for this reason.
    #[error("{0}")]
    ByDevice(&'static str),
    /// The peer has closed it.
    #[error("the client closed the connection")]
    ByPeer,
    /// Another client has replaced this one.
    #[error("another client has connected")]
    Replaced,
    /// The peer has not sent or taken a byte for a time.
    #[error("the client {} nothing for {} s", verb(.reads), .time.as_secs_f64())]
    Idle {
        /// The time without a byte.
        time: Duration,
        /// Whether the peer has taken all bytes that were sent to it.
        reads: bool,
    },
    /// The peer takes no bytes any more.
    #[error("the peer does not read")]
    Stalled,
    /// The transport has failed, or a connection could not be made.
    #[error("{0}")]
    Failed(String),
    /// The host is stopped by its owner.
    #[error("the device is switched off")]
    Stopped,
}

impl From<io::Error> for ConnectionEnd {
    fn from(error: io::Error) -> Self {
        Self::Failed(error.to_string())
    }
}

fn verb(reads: &bool) -> &'static str {
    if *reads { "sends" } else { "takes" }
}
