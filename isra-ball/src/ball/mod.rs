//! The ball.

mod config;
pub mod machine;

use core::time::Duration;

use robot_session::end::{ByteDecoder, Core, CoreOf, Echo, End, EventQueue, QueueSpace};
use robot_session::{Decoder as _, EchoError, Unexpected};

pub use config::BallConfig;
#[doc(hidden)]
pub use config::Rule;

use crate::envelope::ENQ;
use crate::error::ConfigError;
use crate::keys::Keys;
use crate::message::{Packet, Status};
use machine::{Action, BallMachine, Input, Reply};

/// The ball: answers each ENQ with one packet, and sends nothing else (§4.2).
///
/// The order of calls is the [`Session`](robot_session::Session)'s; [`measure`](Self::measure) each time that the sensor has
/// new values. There are no timeouts.
///
/// - A reply has the newest values when it is sent. If there are none since the last reply, those are sent again, marked as
///   [`Status::Old`].
/// - Any byte other than ENQ is an event without an effect; an ENQ before the reply to the last one has no effect.
/// - A poll of one connection is not answered on the next. The values outlast it.
/// - Every event is a notice: when more than eight wait, the oldest are dropped.
#[derive(Debug, Clone)]
pub struct Ball {
    core: CoreOf<Self>,
    echo: Echo<{ Packet::LEN }>,
    /// The sensor's values.
    packet: Packet,
}

/// The events of the ball.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "event", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum BallEvent {
    /// This packet was sent as the reply to a poll.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::message"))]
    Reply(Packet),
    /// An ENQ came before the reply to the last one was sent.
    Ignored,
    /// A byte that is not ENQ. The source knows a second kind of request, a telegram, and does not describe it.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::byte"))]
    Unknown(u8),
    /// A notice: the line returns the sent bytes, and [`echo`](BallConfig::echo) is off; or it is on, and other bytes came back.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Echo(EchoError),
    /// A poll came without a connection.
    Unexpected(Unexpected),
}

robot_session::counters! {
    /// Counters of a ball.
    pub struct BallStatistics {
        /// Replies with new values.
        pub fresh: u64,
        /// Replies with values that were sent before.
        pub old: u64,
        /// Polls that came before the reply to the last one was sent.
        pub ignored: u64,
        /// Bytes that were not polls.
        pub unknown: u64,
    }
}

impl Ball {
    /// Creates a ball at rest, without a connection.
    ///
    /// # Errors
    /// [`ConfigError::Identity`] if sensor type or number is out of range.
    pub fn new(config: BallConfig) -> Result<Self, ConfigError> {
        let packet = config.packet()?;
        Ok(Self {
            core: Core::new(config, BallMachine::NEW, ByteDecoder::new()),
            echo: Echo::new(config.echo),
            packet,
        })
    }

    /// Stores new values of the sensor for the next reply.
    pub fn measure(&mut self, force: [i8; 3], moment: [i8; 3], keys: Keys) {
        self.packet = Packet { force, moment, keys, ..self.packet };
        self.advance(Duration::ZERO, Input::Measured, None);
    }

    fn reply(&self, Reply { fresh }: Reply) -> Packet {
        Packet { status: if fresh { Status::Fresh } else { Status::Old }, ..self.packet }
    }
}

impl End for Ball {
    type Machine = BallMachine;
    type Decoder = ByteDecoder;
    type Events = EventQueue<BallEvent, 8>;
    type Statistics = BallStatistics;
    type Payload = ();

    const LINK: &'static str = "isra-ball";
    const END: &'static str = "ball";
    // The buffer of a serial port. Requests that have piled up there have one answer.
    const MAX_INPUT: usize = 4096;
    const MAX_TRANSMIT: usize = Packet::LEN;
    const QUEUE_SPACE: QueueSpace = QueueSpace::NONE;

    robot_session::core!(BallEvent::Unexpected);
    robot_session::echo!(BallEvent::Echo);

    fn next_input(&mut self) -> Option<(Input, Option<()>)> {
        loop {
            match self.core.decoder.next_frame()?.ok()? {
                ENQ => return Some((Input::Enquiry, None)),
                byte => {
                    self.core.statistics.unknown += 1;
                    self.core.events.push_notice(BallEvent::Unknown(byte));
                }
            }
        }
    }

    fn act(&mut self, _now: Duration, action: Action, _: Option<()>) {
        match action {
            Action::Nothing => {}
            Action::Ignore => {
                self.core.statistics.ignored += 1;
                self.core.events.push_notice(BallEvent::Ignored);
            }
            Action::Sent { fresh } => {
                *if fresh { &mut self.core.statistics.fresh } else { &mut self.core.statistics.old } += 1;
                self.core.events.push_notice(BallEvent::Reply(self.reply(Reply { fresh })));
            }
        }
    }

    fn write(&mut self, _now: Duration, reply: Reply, out: &mut [u8]) -> Option<(usize, Input)> {
        let out = out.first_chunk_mut()?;
        *out = self.reply(reply).to_bytes().ok()?;
        self.echo.sent(out, true);
        Some((Packet::LEN, Input::Sent))
    }
}
