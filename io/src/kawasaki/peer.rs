//! The connection of one end to the other, which may be missing.

use std::cell::Cell;
use std::io::{self, ErrorKind};
use std::rc::Rc;
use std::time::Duration;

use kawasaki_msg::START;
use robot_session::{Received, Sent, Transport, Wait};

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

/// A connection, or none: then nothing arrives.
#[derive(Debug)]
pub struct Peer<'a> {
    clock: Clock,
    trace: &'a Trace,
    carrier: Option<Traced<'a, Carrier>>,
    discard_after: Option<Duration>,
    packets: Rc<Cell<Packets>>,
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
            packets: Rc::default(),
            received: false,
        }
    }

    /// The clock of the session.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// The counts of the packets that this end has sent, over all connections.
    pub fn packets(&self) -> Rc<Cell<Packets>> {
        Rc::clone(&self.packets)
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

    /// Returns whether the other end has sent something since the last call.
    pub fn take_received(&mut self) -> bool {
        core::mem::take(&mut self.received)
    }

    /// Ends the connection, if there is one.
    pub fn disconnect(&mut self) {
        self.carrier = None;
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
        let length = if let Sent::Part(length) = sent { length } else { bytes.len() };
        if let Some(packet @ [_, ..]) = bytes.get(..length) {
            self.packets.set(self.packets.get().and(packet));
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
