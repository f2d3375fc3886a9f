//! The connection of one end to the other, which may be missing.

use std::io::{self, ErrorKind};
use std::ops::ControlFlow;
use std::time::Duration;

use kawasaki_msg::START;
use robot_session::{Ended, Received, Sent, Transport, Wait};

use super::meeting::Carrier;
use crate::clock::Clock;
use crate::drive::Traced;
use crate::trace::Trace;

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
    fn add(&mut self, packet: &[u8]) {
        // A value cannot hold the mark that begins a message.
        let messages = packet.iter().filter(|byte| **byte == START).count();
        self.count += 1;
        self.messages += messages as u64;
        self.most_messages = self.most_messages.max(messages);
        self.longest = self.longest.max(packet.len());
    }
}

/// A connection, or none: then nothing arrives.
#[derive(Debug)]
pub struct Peer<'a> {
    clock: Clock,
    trace: &'a Trace,
    carrier: Option<Traced<'a, Carrier>>,
    discard_after: Option<Duration>,
    /// The bytes that this end has sent, over all connections.
    pub packets: Packets,
    /// The other end has sent something since this was looked at.
    received: bool,
}

impl<'a> Peer<'a> {
    /// No connection yet; the bytes of each are added to `trace`.
    pub fn new(trace: &'a Trace) -> Self {
        Self {
            clock: Clock::start(),
            trace,
            carrier: None,
            discard_after: None,
            packets: Packets::default(),
            received: false,
        }
    }

    /// The clock of the session.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// Takes a connection; the previous one ends.
    ///
    /// # Errors
    /// The system's.
    pub fn connect(&mut self, mut carrier: Carrier) -> io::Result<()> {
        if let Some(after) = self.discard_after {
            carrier.discard_after(after)?;
        }
        self.carrier = Some(Traced::new(carrier, self.trace, self.clock));
        Ok(())
    }

    /// Returns whether there is a connection.
    pub fn is_connected(&self) -> bool {
        self.carrier.is_some()
    }

    /// Returns whether the other end has sent something since the last call.
    pub fn take_received(&mut self) -> bool {
        core::mem::take(&mut self.received)
    }

    /// Ends the connection; returns whether there was one.
    pub fn disconnect(&mut self) -> bool {
        self.carrier.take().is_some()
    }
}

impl Transport for Peer<'_> {
    fn now(&self) -> Duration {
        self.clock.now()
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<Received> {
        if let Some(carrier) = &mut self.carrier {
            let received = carrier.receive(buffer, wait)?;
            self.received |= matches!(received, Received::Bytes(_));
            return Ok(received);
        }
        wait.pause()?;
        Ok(Received::Nothing)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        let sent = self.carrier.as_mut().ok_or(ErrorKind::NotConnected)?.send(bytes)?;
        match sent {
            Sent::Part(0) => {}
            Sent::Part(length) => self.packets.add(bytes.get(..length).unwrap_or_default()),
            Sent::Buffered | Sent::Transmitted => self.packets.add(bytes),
        }
        Ok(sent)
    }

    fn wait_for_room(&mut self, wait: Wait<'_>) -> io::Result<()> {
        self.carrier.as_mut().map_or(Ok(()), |carrier| carrier.wait_for_room(wait))
    }

    fn discard_after(&mut self, after: Duration) -> io::Result<()> {
        self.discard_after = Some(after);
        self.carrier.as_mut().map_or(Ok(()), |carrier| carrier.discard_after(after))
    }
}

/// Returns the value that the handler broke with, or the reason to close the connection.
pub fn outcome<B>(
    turn: io::Result<ControlFlow<Ended<B>>>,
    closed: &str,
) -> ControlFlow<B, Result<(), String>> {
    match turn {
        Ok(ControlFlow::Continue(())) => ControlFlow::Continue(Ok(())),
        Ok(ControlFlow::Break(Ended::ByHandler(value))) => ControlFlow::Break(value),
        Ok(ControlFlow::Break(Ended::ByPeer)) => ControlFlow::Continue(Err(closed.into())),
        Ok(ControlFlow::Break(Ended::Stalled)) => ControlFlow::Continue(Err("the peer does not read".into())),
        Err(error) => ControlFlow::Continue(Err(error.to_string())),
    }
}
