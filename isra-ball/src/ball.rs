use core::time::Duration;

use crate::queue::Queue;
use crate::state::{Reply, ReplyAction, ReplyInput};
use crate::{ENQ, Keys, Packet, SessionError, Status};

/// The ball: answers each ENQ with one packet and says nothing unasked (§4.2).
///
/// Whenever its sensor has new values: [`measure`](Self::measure). Whenever bytes arrive: [`handle_input`](Self::handle_input),
/// then [`poll_transmit`](Self::poll_transmit) until it gives `None` and [`poll_event`](Self::poll_event) until it gives `None`.
/// There are no timeouts.
///
/// - A poll before new values are there is answered with the ones before, marked [`Status::Old`].
/// - Any other byte than ENQ is an event and changes nothing; an ENQ while a reply has not been taken yet asks for nothing more.
/// - The event queue holds eight. When it is full the oldest is given up.
#[derive(Debug, Clone)]
pub struct Ball {
    packet: Packet,
    bytes: [u8; Packet::LEN],
    reply: Reply,
    events: Queue<BallEvent>,
}

/// What the ball has to tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum BallEvent {
    /// This packet answers a poll.
    Reply(Packet),
    /// An ENQ came before the reply to the last one was taken.
    Ignored,
    /// A byte that is not ENQ. The source knows a second kind of request, a telegram, and does not describe it.
    Unknown(u8),
}

impl Ball {
    /// A ball at rest of a sensor type and number, each 0..=7.
    ///
    /// # Errors
    /// [`SessionError::Identity`] if one of them is out of range.
    pub fn new(sensor_type: u8, sensor: u8) -> Result<Self, SessionError> {
        let packet = Packet {
            sensor_type,
            sensor,
            status: Status::Old,
            force: [0; 3],
            moment: [0; 3],
            keys: Keys::NONE,
        };
        let bytes = packet.to_bytes()?;
        Ok(Self { packet, bytes, reply: Reply::Ready, events: Queue::new() })
    }

    /// New values from the sensor, for the next poll.
    pub fn measure(&mut self, force: [i8; 3], moment: [i8; 3], keys: Keys) {
        self.packet = Packet { status: Status::Fresh, force, moment, keys, ..self.packet };
    }

    /// Takes bytes from the line.
    pub fn handle_input(&mut self, _now: Duration, bytes: &[u8]) {
        for &byte in bytes {
            if byte == ENQ {
                self.enquire();
            } else {
                self.events.push(BallEvent::Unknown(byte));
            }
        }
    }

    /// Time changes nothing here: the verb is there for loops that drive every session alike.
    pub fn handle_timeout(&mut self, _now: Duration) {}

    /// Writes the reply when there is one; the bytes written. A slice of fewer than 12 bytes gets nothing, and the reply waits.
    pub fn poll_transmit(&mut self, _now: Duration, out: &mut [u8]) -> Option<usize> {
        let out = out.first_chunk_mut().filter(|_| self.reply == Reply::Replying)?;
        *out = self.bytes;
        (self.reply, _) = self.reply.on(ReplyInput::Sent);
        Some(Packet::LEN)
    }

    /// The next event.
    pub fn poll_event(&mut self) -> Option<BallEvent> {
        self.events.pop()
    }

    /// Never: the ball waits for ENQ.
    pub fn poll_timeout(&self) -> Option<Duration> {
        None
    }

    /// The events given up because nobody took them.
    pub fn dropped_events(&self) -> u64 {
        self.events.dropped()
    }

    fn enquire(&mut self) {
        let (reply, action) = self.reply.on(ReplyInput::Enq);
        self.reply = reply;
        match action {
            ReplyAction::MakeReply => {
                if let Ok(bytes) = self.packet.to_bytes() {
                    self.bytes = bytes;
                }
                self.events.push(BallEvent::Reply(self.packet));
                self.packet.status = Status::Old;
            }
            ReplyAction::Ignore => self.events.push(BallEvent::Ignored),
            ReplyAction::Nothing => {}
        }
    }
}
