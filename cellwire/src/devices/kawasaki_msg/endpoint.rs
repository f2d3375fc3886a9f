//! The loop of an end: its connections, and their reports.

use std::cell::Cell;
use std::io::{self, ErrorKind};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Error, Result};
use cellwire_sim::host::{Change, ConnectionEnd, Endpoint, HostedSession, Notice, State, attend};
use kawasaki_msg::START;
use robot_session::{ReceiveOutcome, SendOutcome, Transport, Wait};

use super::peer_endpoint::{PeerEndpoint, Side};
use cellwire_io::clock::Clock;
use cellwire_io::trace::{Trace, TraceDirection};

/// The interval at which an end checks for another peer and for commands to the simulator.
const POLL_INTERVAL: Duration = Duration::from_millis(20);

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

/// A report of an end while it runs.
#[derive(Debug)]
pub enum Report<'a, E> {
    /// An event of the session.
    Event(E),
    /// A change of the connection.
    Connection(Connection<'a>),
    /// Received bytes were handled in this time.
    Handled(Duration),
    /// Bytes of the session are sent next: state that must survive the program is to be stored.
    Sending,
    /// The events of a turn have been reported.
    Settled,
}

/// A report of an end's connection. A reason is reported once until a connection is made.
#[derive(Debug)]
pub enum Connection<'a> {
    /// A connection with this peer is open.
    Connected(&'a str),
    /// No connection could be opened, or one has ended; the reason.
    Disconnected(&'a str),
    /// The session's bytes were written to this file.
    Traced(PathBuf),
}

/// Runs an end while `goes_on`. One peer at a time: over TCP a new connection takes the place of the previous one, over UDP
/// another robot is answered when the previous one is silent. The bytes of each connection are added to `trace`. Returns the
/// counts of the packets that this end has sent, over all connections.
///
/// # Errors
/// The errors of `observe`, and an endpoint that fails.
pub fn run<S: HostedSession>(
    side: Side,
    meeting: &mut PeerEndpoint,
    trace: &Trace,
    clock: Clock,
    session: &mut S,
    goes_on: impl FnMut() -> bool,
    mut observe: impl FnMut(&mut S, Report<'_, S::Event>) -> Result<()>,
) -> Result<Packets> {
    let traffic = Traffic::default();
    let (carrier, discard_after, retry_at) = (None, None, Duration::ZERO);
    let connections =
        Connections { side, meeting, clock, trace, traffic: &traffic, carrier, discard_after, retry_at };
    let (mut is_connected, mut reported) = (false, String::new());
    let mut pass = |session: &mut S, notice: Notice<'_, S::Event>| {
        if let Some(begin) = traffic.received.take() {
            observe(session, Report::Handled(begin.elapsed()))?;
        }
        match notice {
            Notice::Event(_, event) => observe(session, Report::Event(event)),
            Notice::Sending => observe(session, Report::Sending),
            Notice::Settled => observe(session, Report::Settled),
            Notice::Connected(peer) => {
                (is_connected, reported) = (true, String::new());
                observe(session, Report::Connection(Connection::Connected(peer)))
            }
            Notice::Disconnected(_, ending) => {
                let why = side.reason(ending);
                let is_news = reported != why && !matches!(ending, ConnectionEnd::Stopped);
                if core::mem::take(&mut is_connected) || is_news {
                    observe(session, Report::Connection(Connection::Disconnected(&why)))?;
                }
                let traced = trace.finish(&why).map(Connection::Traced);
                reported = why;
                traced.map_or(Ok(()), |traced| observe(session, Report::Connection(traced)))
            }
            _ => Ok(()),
        }
    };
    let outcome = attend(session, connections, POLL_INTERVAL, goes_on, &mut pass);
    session.handle_disconnected(clock.now());
    let ended = pass(session, Notice::Disconnected("", &ConnectionEnd::Stopped));
    outcome.and(ended).map(|()| traffic.packets.get())
}

/// The bytes of an end's connections.
#[derive(Debug, Default)]
struct Traffic {
    packets: Cell<Packets>,
    /// The time at which bytes were received that are not handled yet.
    received: Cell<Option<Instant>>,
}

/// The connections of an end to its peers. Without a connection nothing arrives.
struct Connections<'a> {
    side: Side,
    meeting: &'a mut PeerEndpoint,
    clock: Clock,
    trace: &'a Trace,
    traffic: &'a Traffic,
    carrier: Option<Box<dyn Transport>>,
    discard_after: Option<Duration>,
    /// The time of the next attempt to connect.
    retry_at: Duration,
}

impl Connections<'_> {
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
                self.carrier = Some(carrier);
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
        if let ReceiveOutcome::Bytes(length) = received {
            self.meeting.answered();
            let bytes = buffer.get(..length).unwrap_or_default();
            self.trace.add(self.clock.now(), TraceDirection::Received, bytes);
            self.traffic.received.set(Some(Instant::now()));
        }
        Ok(received)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        let begun = self.clock.now();
        let sent = self.carrier.as_mut().ok_or(ErrorKind::NotConnected)?.send(bytes)?;
        let length = if let SendOutcome::Part(length) = sent { length } else { bytes.len() };
        if let Some(packet @ [_, ..]) = bytes.get(..length) {
            self.trace.add(begun, TraceDirection::Sent, packet);
            self.traffic.packets.set(self.traffic.packets.get().and(packet));
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
