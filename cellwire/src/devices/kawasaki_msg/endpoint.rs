//! The connections of an end, for its host.

use std::cell::Cell;
use std::io::{self, ErrorKind};
use std::rc::Rc;
use std::time::Duration;

use anyhow::{Error, Result};
use cellwire_sim::host::{Change, ConnectionEnd, Endpoint, Notice, State};
use kawasaki_msg::START;
use robot_session::{ReceiveOutcome, SendOutcome, Transport, Wait};

use super::peer_endpoint::{Carrier, PeerEndpoint};
use cellwire_io::clock::Clock;
use cellwire_io::drive::TracedTransport;
use cellwire_io::trace::Trace;

/// The interval at which a host checks for another peer and for commands to the simulator.
pub(super) const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// The end that is connected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    /// The PC connects whenever it can.
    Pc,
    /// The robot connects when its session requests it, if PCs do not connect to it.
    Robot,
}

impl Side {
    /// Returns the end of a connection in words.
    pub(super) fn reason(self, ending: &ConnectionEnd) -> String {
        let peer = if self == Self::Pc { "robot" } else { "PC" };
        match ending {
            ConnectionEnd::ByPeer => format!("the {peer} closed the connection"),
            ConnectionEnd::Stopped if self == Self::Robot => "the robot is switched off".into(),
            ConnectionEnd::Stopped => "the PC has ended".into(),
            ConnectionEnd::Replaced => format!("another {peer} has connected"),
            ending => ending.to_string(),
        }
    }
}

/// Counts of the packets that an end has sent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Packets {
    /// The number of packets.
    pub count: u64,
    /// The number of messages in all packets.
    pub messages: u64,
    /// The number of messages in the packet that has most.
    pub most_messages: usize,
    /// The number of bytes of the longest packet.
    pub longest: usize,
}

impl Packets {
    /// Returns the counts of both.
    #[must_use]
    pub fn merge(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            messages: self.messages + other.messages,
            most_messages: self.most_messages.max(other.most_messages),
            longest: self.longest.max(other.longest),
        }
    }

    fn and(self, packet: &[u8]) -> Self {
        // A value cannot hold the mark that begins a message.
        let messages = packet.iter().filter(|byte| **byte == START).count();
        Self {
            count: self.count + 1,
            messages: self.messages + messages as u64,
            most_messages: self.most_messages.max(messages),
            longest: self.longest.max(packet.len()),
        }
    }
}

/// The connections of an end to its peers. Without a connection nothing arrives.
pub(super) struct Connections<'a> {
    side: Side,
    meeting: &'a mut PeerEndpoint,
    clock: Clock,
    trace: &'a Trace,
    carrier: Option<TracedTransport<'a, Carrier>>,
    discard_after: Option<Duration>,
    packets: Rc<Cell<Packets>>,
    /// The time of the next attempt to connect.
    retry_at: Duration,
}

impl<'a> Connections<'a> {
    /// Creates an end without a connection; the bytes of each connection are added to `trace`.
    pub(super) fn new(side: Side, meeting: &'a mut PeerEndpoint, trace: &'a Trace) -> Self {
        let (clock, packets, retry_at) = (Clock::start(), Rc::default(), Duration::ZERO);
        Self { side, meeting, clock, trace, carrier: None, discard_after: None, packets, retry_at }
    }

    /// Returns the clock of the session.
    pub(super) fn clock(&self) -> Clock {
        self.clock
    }

    /// Returns the counts of the packets that this end has sent, over all connections.
    pub(super) fn packets(&self) -> Rc<Cell<Packets>> {
        Rc::clone(&self.packets)
    }

    /// Returns whether a connection is wanted now.
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
        let now = self.clock.now();
        if !self.is_wanted(device, now) {
            return Ok(None);
        }
        let why = match self.meeting.meet()? {
            Ok(Some((mut carrier, peer))) => {
                if let Some(after) = self.discard_after {
                    carrier.discard_after(after)?;
                }
                self.carrier = Some(TracedTransport::new(carrier, self.trace, self.clock));
                return Ok(Some(Change::Connected(peer)));
            }
            Ok(None) if self.meeting.takes_another() || self.side == Side::Pc => return Ok(None),
            Ok(None) => "no PC has connected".into(),
            Err(_) if self.meeting.takes_another() => return Ok(None),
            Err(why) => why,
        };
        self.retry_at = now.saturating_add(self.meeting.pause());
        Ok(Some(Change::Disconnected(ConnectionEnd::Failed(why))))
    }

    fn end(&mut self, _: &ConnectionEnd) -> bool {
        self.carrier = None;
        self.retry_at = self.clock.now().saturating_add(self.meeting.pause());
        true
    }
}

impl Transport for Connections<'_> {
    fn now(&self) -> Duration {
        self.clock.now()
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        let Some(carrier) = &mut self.carrier else {
            wait.pause()?;
            return Ok(ReceiveOutcome::Nothing);
        };
        let received = carrier.receive(buffer, wait)?;
        if let ReceiveOutcome::Bytes(_) = received {
            self.meeting.answered();
        }
        Ok(received)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        let sent = self.carrier.as_mut().ok_or(ErrorKind::NotConnected)?.send(bytes)?;
        let length = if let SendOutcome::Part(length) = sent { length } else { bytes.len() };
        if let Some(packet @ [_, ..]) = bytes.get(..length) {
            self.packets.set(self.packets.get().and(packet));
        }
        Ok(sent)
    }

    fn discard_after(&mut self, after: Duration) -> io::Result<()> {
        self.discard_after = Some(after);
        self.carrier.as_mut().map_or(Ok(()), |carrier| carrier.discard_after(after))
    }

    fn wait_for_room(&mut self, wait: Wait<'_>) -> io::Result<()> {
        self.carrier.as_mut().map_or(Ok(()), |carrier| carrier.wait_for_room(wait))
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
    /// A connection with this peer is open.
    Connected(&'a str),
    /// No connection could be opened, or one has ended; the reason.
    Disconnected(&'a str),
    /// The session's bytes were written to this file.
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
                let is_news = self.reported != why && !matches!(ending, ConnectionEnd::Stopped);
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
