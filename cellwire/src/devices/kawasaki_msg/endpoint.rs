//! A simulated end's connections, for its host.

use std::cell::Cell;
use std::io;
use std::rc::Rc;
use std::time::Duration;

use anyhow::{Error, Result};
use cellwire_sim::host::{Change, Ending, Endpoint, Notice, State};
use robot_session::{Received, Sent, Transport, Wait};

use cellwire_io::clock::Clock;
use cellwire_io::kawasaki::meeting::Meeting;
use cellwire_io::kawasaki::peer::{Packets, Peer};
use cellwire_io::trace::Trace;

/// A host looks for another peer, and a command to the simulator waits, for this long at most.
pub(super) const LOOK: Duration = Duration::from_millis(20);

/// The end that is connected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    /// The PC connects whenever it can.
    Pc,
    /// The robot connects when its session requests it, if PCs do not connect to it.
    Robot,
}

impl Side {
    /// The end of a connection in words.
    pub(super) fn reason(self, ending: &Ending) -> String {
        let peer = if self == Self::Pc { "robot" } else { "PC" };
        match ending {
            Ending::ByPeer => format!("the {peer} closed the connection"),
            Ending::Stopped if self == Self::Robot => "the robot is switched off".into(),
            Ending::Stopped => "the PC has ended".into(),
            Ending::Replaced => format!("another {peer} has connected"),
            ending => ending.to_string(),
        }
    }
}

/// The connections of an end to its peers.
pub(super) struct Connections<'a> {
    side: Side,
    meeting: &'a mut Meeting,
    peer: Peer<'a>,
    /// The time of the next attempt to connect.
    retry_at: Duration,
}

impl<'a> Connections<'a> {
    pub(super) fn new(side: Side, meeting: &'a mut Meeting, trace: &'a Trace) -> Self {
        Self { side, meeting, peer: Peer::new(trace), retry_at: Duration::ZERO }
    }

    /// The clock of the session.
    pub(super) fn clock(&self) -> Clock {
        self.peer.clock()
    }

    /// The counts of the packets that this end has sent.
    pub(super) fn packets(&self) -> Rc<Cell<Packets>> {
        self.peer.packets()
    }

    /// Whether a connection is looked for now.
    fn is_wanted(&self, device: State, now: Duration) -> bool {
        match (self.meeting.takes_another(), self.side) {
            (true, _) => device.accepts,
            (false, Side::Robot) => device.connects,
            (false, Side::Pc) => device.accepts && !device.is_connected && now >= self.retry_at,
        }
    }
}

impl Endpoint for Connections<'_> {
    type Error = Error;

    fn look(&mut self, device: State) -> Result<Option<Change>> {
        if self.peer.take_received() {
            self.meeting.answered();
        }
        let now = self.peer.now();
        if !self.is_wanted(device, now) {
            return Ok(None);
        }
        let why = match self.meeting.meet()? {
            Ok(Some((carrier, peer))) => {
                self.peer.connect(carrier)?;
                return Ok(Some(Change::Connected(peer)));
            }
            Ok(None) if self.meeting.takes_another() || self.side == Side::Pc => return Ok(None),
            Ok(None) => "no PC has connected".into(),
            Err(_) if self.meeting.takes_another() => return Ok(None),
            Err(why) => why,
        };
        self.retry_at = now.saturating_add(self.meeting.pause());
        Ok(Some(Change::Disconnected(Ending::Failed(why))))
    }

    fn end(&mut self, _: &Ending) -> bool {
        self.peer.disconnect();
        self.retry_at = self.peer.now().saturating_add(self.meeting.pause());
        true
    }
}

impl Transport for Connections<'_> {
    fn now(&self) -> Duration {
        self.peer.now()
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<Received> {
        self.peer.receive(buffer, wait)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        self.peer.send(bytes)
    }

    fn discard_after(&mut self, after: Duration) -> io::Result<()> {
        self.peer.discard_after(after)
    }
}

/// The reports of connections: each reason once until a connection is made.
#[derive(Debug)]
pub(super) struct Reports {
    side: Side,
    is_connected: bool,
    reported: String,
}

/// A report of an end's connection.
#[derive(Debug)]
pub enum Connection<'a> {
    /// A connection is open.
    Connected(&'a str),
    /// No connection could be opened, or one has ended.
    Disconnected(&'a str),
    /// The session's bytes were written there.
    Traced(std::path::PathBuf),
}

impl Reports {
    pub(super) fn new(side: Side) -> Self {
        Self { side, is_connected: false, reported: String::new() }
    }

    /// Passes a change of the connection on.
    pub(super) fn pass<E>(
        &mut self,
        notice: &Notice<'_, E>,
        trace: &Trace,
        mut notify: impl FnMut(Connection<'_>) -> Result<()>,
    ) -> Result<()> {
        match notice {
            Notice::Connected(peer) => {
                (self.is_connected, self.reported) = (true, String::new());
                notify(Connection::Connected(peer))
            }
            Notice::Disconnected(_, ending) => {
                let why = self.side.reason(ending);
                let is_news = self.reported != why && !matches!(ending, Ending::Stopped);
                if core::mem::take(&mut self.is_connected) || is_news {
                    notify(Connection::Disconnected(&why))?;
                }
                let traced = trace.finish(&why);
                self.reported = why;
                traced.map_or(Ok(()), |path| notify(Connection::Traced(path)))
            }
            _ => Ok(()),
        }
    }
}
