//! The server's end ("slave").

use core::time::Duration;

use crate::decoder::{Decoder, Framing};
use crate::error::DecodeError;
use crate::frame::{Frame, Side};
use crate::message::{Exception, function};
use crate::registers::Registers;
use crate::timing;

/// How a server is reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Config {
    /// The transport.
    pub framing: Framing,
    /// The unit that it is; it says nothing to requests for others. `None` answers every unit with its own identifier, as most
    /// Modbus TCP servers do.
    pub unit: Option<u8>,
    /// Whether unit 0 is a broadcast: carried out, never answered. On TCP, 0 is often the server itself.
    pub broadcast: bool,
}

impl Config {
    /// Modbus TCP: every unit is answered.
    pub const fn tcp() -> Self {
        Self { framing: Framing::Tcp, unit: None, broadcast: false }
    }

    /// RTU on a serial line.
    pub const fn rtu(unit: u8, baud: u32) -> Self {
        Self { framing: Framing::Rtu { silence: timing::silence(baud) }, unit: Some(unit), broadcast: true }
    }

    /// RTU frames through a TCP connection.
    pub const fn rtu_over_tcp(unit: u8) -> Self {
        Self { framing: Framing::RTU_OVER_TCP, unit: Some(unit), broadcast: true }
    }
}

/// What happened, for a log. Nothing needs to be done about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event {
    /// A request was carried out, or refused with an exception.
    Served {
        /// The transaction on TCP.
        transaction: Option<u16>,
        /// The unit; 0 is a broadcast where [`Config::broadcast`] says so.
        unit: u8,
        /// The function code.
        function: u8,
        /// Why it was refused.
        exception: Option<Exception>,
    },
    /// The stream is damaged. On TCP the client is out of step: best close the connection.
    Damaged(DecodeError),
}

/// One connection to a server, or one serial line.
///
/// 1. [`handle_input`](Self::handle_input) what arrived, or [`handle_timeout`](Self::handle_timeout) when
///    [`poll_timeout`](Self::poll_timeout) has come; 2. call [`poll_transmit`](Self::poll_transmit) with the registers and send
///    what it writes, until it gives `None`: requests are carried out there, one reply a call, in the order of their arrival;
///    3. [`poll_event`](Self::poll_event) for a log, or never.
///
/// The registers are passed in, so that any number of connections can share one set.
///
/// Damage costs the frames that it touches and is told once; nothing is answered to it. While replies are not taken away,
/// requests wait in a buffer of [`Decoder::CAPACITY`] bytes, and `handle_input` takes no more than fits. Of events that nobody
/// polls, the last eight are kept.
///
/// On a serial line a request is carried out when the line has been silent for 3.5 characters, as the frame format wants it. A
/// server that shares its line with others hears their replies as damage.
#[derive(Debug, Clone)]
pub struct Server {
    config: Config,
    decoder: Decoder,
    last_input: Duration,
    told: bool,
    events: Events,
}

impl Server {
    /// The room that [`poll_transmit`](Self::poll_transmit) needs.
    pub const MAX_TRANSMIT: usize = Frame::MAX_LEN;

    /// A server without anything received.
    pub const fn new(config: Config) -> Self {
        let decoder = Decoder::new(config.framing, Side::Client);
        Self { config, decoder, last_input: Duration::ZERO, told: false, events: Events::new() }
    }

    /// Takes bytes from the client, and says how many: fewer than given until [`poll_transmit`](Self::poll_transmit) has made
    /// room.
    pub fn handle_input(&mut self, now: Duration, bytes: &[u8]) -> usize {
        self.handle_timeout(now);
        let taken = self.decoder.push(bytes);
        if taken > 0 {
            self.last_input = now;
        }
        taken
    }

    /// Sees whether the line has fallen silent.
    pub fn handle_timeout(&mut self, now: Duration) {
        if let Some(silence) = self.config.framing.silence()
            && self.decoder.pending() > 0
            && now >= self.last_input + silence
        {
            self.decoder.finish();
        }
    }

    /// Carries requests out until one has a reply, and writes that; `None` when there is nothing to send now.
    ///
    /// `out` has room for [`MAX_TRANSMIT`](Self::MAX_TRANSMIT) bytes: with less, nothing is done.
    #[inline]
    pub fn poll_transmit<R: Registers + ?Sized>(
        &mut self,
        now: Duration,
        registers: &mut R,
        out: &mut [u8],
    ) -> Option<usize> {
        let out = out.first_chunk_mut::<{ Frame::MAX_LEN }>()?;
        self.handle_timeout(now);
        if now < self.last_input + self.config.framing.idle() {
            return None;
        }
        loop {
            let range = match self.decoder.advance() {
                Some(Ok(range)) => range,
                Some(Err(error)) => {
                    self.tell_damage(error);
                    continue;
                }
                None => {
                    if let (Some(error), Framing::Tcp) = (self.decoder.damage(), self.config.framing) {
                        self.tell_damage(error);
                    }
                    return None;
                }
            };
            self.told = false;
            let Some(frame) = self.decoder.frame(range) else { continue };
            let broadcast = self.config.broadcast && frame.unit == 0;
            if !broadcast && self.config.unit.is_some_and(|unit| unit != frame.unit) {
                continue;
            }
            let Some(len) = frame.serve(registers, out) else { continue };
            let (transaction, unit) = (frame.transaction, frame.unit);
            let function = frame.pdu.first().copied().unwrap_or_default();
            let reply = if transaction.is_some() { out.get(7..len) } else { out.get(1..len - 2) };
            let exception = match reply {
                Some([code, exception]) if *code >= function::EXCEPTION => Some((*exception).into()),
                _ => None,
            };
            self.events.push(Event::Served { transaction, unit, function, exception });
            if !broadcast {
                return Some(len);
            }
        }
    }

    /// What happened, oldest first.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.events.pop()
    }

    /// When to call [`handle_timeout`](Self::handle_timeout) and then [`poll_transmit`](Self::poll_transmit).
    pub fn poll_timeout(&self) -> Option<Duration> {
        let silence = self.config.framing.silence()?;
        (self.decoder.pending() > 0).then(|| self.last_input + silence)
    }

    /// The connection is a new one: what the old one left is forgotten.
    pub fn reset(&mut self) {
        self.decoder.reset();
        self.told = false;
    }

    fn tell_damage(&mut self, error: DecodeError) {
        if !self.told {
            self.told = true;
            self.events.push(Event::Damaged(error));
        }
    }
}

/// The last events that nobody polled yet.
#[derive(Debug, Clone)]
struct Events {
    ring: [Option<Event>; 8],
    next: usize,
}

impl Events {
    const fn new() -> Self {
        Self { ring: [None; 8], next: 0 }
    }

    #[inline]
    fn push(&mut self, event: Event) {
        if let Some(place) = self.ring.get_mut(self.next % 8) {
            *place = Some(event);
        }
        self.next = (self.next + 1) % 8;
    }

    fn pop(&mut self) -> Option<Event> {
        let (newer, older) = self.ring.split_at_mut(self.next);
        older.iter_mut().chain(newer).find_map(Option::take)
    }
}
