//! A simulated serial line as the endpoint of a device.

use std::io;
use std::time::Duration;

use anyhow::Result;
use cellwire_sim::host::{Change, ConnectionEnd, Endpoint, HostedSession, Notice, State, attend};
use robot_session::{ReceiveOutcome, SendOutcome, Transport, Wait};

use crate::devices::device::POLL_INTERVAL;
use crate::io::line::Line;
use crate::io::priority::{self, ThreadRole};

/// The time during which a device on a line is connected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Presence {
    /// While a client has the other end open.
    OfClient,
    /// Always, unless a fault ends the connection: the device does not see clients.
    Always,
}

/// Runs a device on a line, or on a transport around one, while `goes_on`, or until the line is gone for good.
///
/// # Errors
/// The errors of `observe`.
pub fn on_line<S: HostedSession>(
    session: &mut S,
    line: impl Transport + AsMut<Line>,
    presence: Presence,
    goes_on: impl FnMut() -> bool,
    observe: impl FnMut(&mut S, Notice<'_, S::Event>) -> Result<()>,
) -> Result<()> {
    priority::raise(ThreadRole::Hardware);
    attend(session, OnLine { transport: line, presence, left: 0 }, POLL_INTERVAL, goes_on, observe)
}

struct OnLine<T> {
    transport: T,
    presence: Presence,
    /// The number of clients that had disconnected at the last look.
    left: usize,
}

impl<T: Transport + AsMut<Line>> Endpoint for OnLine<T> {
    type Error = io::Error;

    fn look(&mut self, device: State) -> io::Result<Option<Change>> {
        let line = self.transport.as_mut();
        if device.is_held {
            line.pass();
        }
        if !device.accepts {
            line.discard();
        }
        // The next client may be connected already.
        let has_left = core::mem::replace(&mut self.left, line.left()) != line.left();
        let is_there = device.accepts
            && match self.presence {
                Presence::OfClient => line.is_connected() && !(device.is_connected && has_left),
                Presence::Always => !line.hangs_up(),
            };
        Ok(match (device.is_connected, is_there) {
            (false, true) => Some(Change::Connected(String::new())),
            (true, false) => Some(Change::Disconnected(ConnectionEnd::ByPeer)),
            _ => None,
        })
    }

    fn end(&mut self, ending: &ConnectionEnd) -> bool {
        self.transport.as_mut().hang_up();
        matches!(ending, ConnectionEnd::ByDevice(_))
    }
}

impl<T: Transport + AsMut<Line>> Transport for OnLine<T> {
    fn now(&self) -> Duration {
        self.transport.now()
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        self.transport.receive(buffer, wait)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        self.transport.send(bytes)
    }
}
