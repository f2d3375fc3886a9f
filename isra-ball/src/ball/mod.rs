//! The ball.

mod config;
pub mod machine;

use core::time::Duration;

use robot_session::{EventQueue, Session, Unexpected};

pub use config::BallConfig;
#[doc(hidden)]
pub use config::Rule;

use crate::envelope::ENQ;
use crate::error::ConfigError;
use crate::keys::Keys;
use crate::message::{Packet, Status};
use machine::{Action, BallMachine, Input};

/// The ball: answers each ENQ with one packet and sends nothing unasked (§4.2).
///
/// The order of calls is the [`Session`]'s; [`measure`](Self::measure) whenever the sensor has new values. There are no timeouts.
///
/// - A reply has the newest values when it is sent. If there are none since the last reply, those are sent again, marked as
///   [`Status::Old`].
/// - Any other byte than ENQ is an event and changes nothing; an ENQ before the reply to the last one is sent asks for nothing more.
/// - A poll of one connection is not answered on the next. The values outlast it.
/// - Every event is a notice: of more than eight that nobody takes, the oldest are dropped.
#[derive(Debug, Clone)]
pub struct Ball {
    config: BallConfig,
    machine: BallMachine,
    /// The sensor's values.
    packet: Packet,
    events: EventQueue<BallEvent, 8>,
    statistics: BallStatistics,
}

/// What the ball reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum BallEvent {
    /// This packet was sent as the reply to a poll.
    Reply(Packet),
    /// An ENQ came before the reply to the last one was sent.
    Ignored,
    /// A byte that is not ENQ. The source knows a second kind of request, a telegram, and does not describe it.
    Unknown(u8),
    /// A poll came without a connection.
    Unexpected(Unexpected),
}

/// What a ball has done.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct BallStatistics {
    /// Replies with new values.
    pub fresh: u64,
    /// Replies with values that were sent before.
    pub old: u64,
    /// Polls that came before the reply to the last one was sent.
    pub ignored: u64,
    /// Bytes that were no poll.
    pub unknown: u64,
    /// Inputs that the state does not allow.
    pub unexpected: u64,
    /// Notices that were dropped because nobody took them.
    pub dropped_notices: u64,
}

impl Ball {
    /// A ball at rest, without a connection.
    ///
    /// # Errors
    /// [`ConfigError::Identity`] if sensor type or number is out of range.
    pub fn new(config: BallConfig) -> Result<Self, ConfigError> {
        Ok(Self {
            packet: config.packet()?,
            config,
            machine: BallMachine::NEW,
            events: EventQueue::new(),
            statistics: BallStatistics::default(),
        })
    }

    /// New values from the sensor, for the next reply.
    pub fn measure(&mut self, force: [i8; 3], moment: [i8; 3], keys: Keys) {
        self.packet = Packet { force, moment, keys, ..self.packet };
        self.advance(Duration::ZERO, Input::Measured);
    }

    /// The state that decides what happens next.
    pub fn machine(&self) -> &BallMachine {
        &self.machine
    }

    fn advance(&mut self, now: Duration, input: Input) -> Action {
        match self.machine.on(now, input, &self.config) {
            Ok(Action::Ignore) => {
                self.statistics.ignored += 1;
                self.events.push_notice(BallEvent::Ignored);
                Action::Ignore
            }
            Ok(action) => action,
            Err(unexpected) => {
                self.statistics.unexpected += 1;
                self.events.push_notice(BallEvent::Unexpected(unexpected));
                Action::None
            }
        }
    }
}

impl Session for Ball {
    type Event = BallEvent;
    type Statistics = BallStatistics;

    const MAX_TRANSMIT: usize = Packet::LEN;

    fn handle_connected(&mut self, now: Duration) {
        self.advance(now, Input::Connected);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.advance(now, Input::Disconnected);
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        for &byte in bytes {
            if byte == ENQ {
                self.advance(now, Input::Enquiry);
            } else {
                self.statistics.unknown += 1;
                self.events.push_notice(BallEvent::Unknown(byte));
            }
        }
    }

    fn handle_timeout(&mut self, _now: Duration) {}

    fn poll_event(&mut self) -> Option<BallEvent> {
        self.events.pop()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        let out = out.first_chunk_mut().filter(|_| self.machine.transmits())?;
        let Action::Transmit { fresh } = self.advance(now, Input::Reply) else { return None };
        let packet = Packet { status: if fresh { Status::Fresh } else { Status::Old }, ..self.packet };
        *out = packet.to_bytes().ok()?;
        *if fresh { &mut self.statistics.fresh } else { &mut self.statistics.old } += 1;
        self.events.push_notice(BallEvent::Reply(packet));
        Some(Packet::LEN)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.machine.deadline()
    }

    fn statistics(&self) -> BallStatistics {
        BallStatistics { dropped_notices: self.events.dropped_notices(), ..self.statistics }
    }
}
