//! The workstation's line with its software handshake (§5): XOFF holds what is sent, XON lets it continue. So does time, as in
//! [`HostConfig::max_hold`](val2_viewer::HostConfig): an XON may be lost, and an XOFF may be another byte that was corrupt.
//!
//! A packet leaves in pieces at the line's own pace, so that little follows an XOFF. Nothing is lost and nothing piles up:
//! the rest of one packet waits, and the session makes no other before it has left. Requests that come meanwhile are given
//! to the session together, which answers them with one packet.

use std::collections::VecDeque;
use std::io;
use std::time::Duration;

use robot_session::{ReceiveOutcome, SendOutcome, Transport, Wait};
use val2_alter::timing::transmission_time;

use super::port::Port;

const XON: u8 = 0x11;
const XOFF: u8 = 0x13;

/// The number of bytes that are written at once: the FIFO of a serial chip.
const PIECE: usize = 16;
/// The most bytes of the workstation that wait for the session; later bytes are requests like these.
const REQUESTS: usize = 64;

/// The port, and the bytes that its handshake has stopped.
pub(super) struct Handshake {
    port: Port,
    baud: u32,
    max_hold: Duration,
    /// The time until which XOFF holds the line; `None` if it does not.
    held_until: Option<Duration>,
    /// The rest of a packet.
    waiting: VecDeque<u8>,
    /// When the next piece of it may be written.
    next_at: Duration,
    /// The requests that came while nothing could be sent.
    requests: Vec<u8>,
}

impl Handshake {
    pub(super) fn new(port: Port, baud: u32, max_hold: Duration) -> Self {
        Self {
            port,
            baud,
            max_hold,
            held_until: None,
            waiting: VecDeque::new(),
            next_at: Duration::ZERO,
            requests: Vec::new(),
        }
    }

    pub(super) fn port(&mut self) -> &mut Port {
        &mut self.port
    }

    /// Returns whether the session may send.
    pub(super) fn is_free(&self) -> bool {
        self.held_until.is_none() && self.waiting.is_empty()
    }

    /// Returns whether the workstation has stopped the line.
    pub(super) fn is_held(&self) -> bool {
        self.held_until.is_some()
    }

    /// Called when another port is used.
    pub(super) fn clear(&mut self) {
        (self.held_until, self.next_at) = (None, Duration::ZERO);
        self.waiting.clear();
        self.requests.clear();
    }

    /// Sends the bytes that may be sent, and stores received ones.
    pub(super) fn wait(&mut self, wait: Duration) {
        let mut buffer = [0; REQUESTS];
        let length = self.read(wait, &mut buffer);
        let room = REQUESTS - self.requests.len().min(REQUESTS);
        self.requests.extend(buffer.iter().take(length.min(room)));
    }

    /// Sends the bytes that may be sent, and reads received ones, without XON and XOFF.
    fn read(&mut self, wait: Duration, buffer: &mut [u8]) -> usize {
        let now = self.port.now();
        self.held_until = self.held_until.filter(|until| now < *until);
        self.write_piece(now);
        let next = (!self.is_held() && !self.waiting.is_empty()).then(|| self.next_at.saturating_sub(now));
        let length = self.port.read(next.map_or(wait, |next| wait.min(next)), buffer);
        let (mut kept, received) = (0, buffer.get(..length).unwrap_or_default().to_vec());
        for byte in received {
            match byte {
                XON => self.held_until = None,
                XOFF => self.held_until = Some(self.port.now().saturating_add(self.max_hold)),
                _ => {
                    if let Some(place) = buffer.get_mut(kept) {
                        (*place, kept) = (byte, kept + 1);
                    }
                }
            }
        }
        kept
    }

    fn write_piece(&mut self, now: Duration) {
        if self.is_held() || self.waiting.is_empty() || now < self.next_at {
            return;
        }
        let piece: Vec<u8> = self.waiting.drain(..self.waiting.len().min(PIECE)).collect();
        self.next_at = now + transmission_time(piece.len(), self.baud);
        self.port.write(&piece);
    }
}

impl Transport for Handshake {
    fn now(&self) -> Duration {
        self.port.now()
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        if !self.requests.is_empty() {
            let length = self.requests.len().min(buffer.len());
            for (place, byte) in buffer.iter_mut().zip(self.requests.drain(..length)) {
                *place = byte;
            }
            return Ok(ReceiveOutcome::Bytes(length));
        }
        Ok(match self.read(wait.limit.unwrap_or_default(), buffer) {
            0 => ReceiveOutcome::Nothing,
            length => ReceiveOutcome::Bytes(length),
        })
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        self.waiting.extend(bytes);
        self.write_piece(self.port.now());
        Ok(SendOutcome::Buffered)
    }

    fn discard_after(&mut self, after: Duration) -> io::Result<()> {
        self.port.discard_after(after)
    }
}
