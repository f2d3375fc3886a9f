//! The graphics workstation that draws the arm.

mod config;
mod decoder;
pub mod machine;

use core::time::Duration;

use robot_session::end::{Core, CoreOf, Echo, End, EventQueue, QueueSpace};
use robot_session::{Decoder as _, EchoError, Unexpected};

#[doc(hidden)]
pub use config::Rule;
pub use config::WorkstationConfig;

use crate::error::{ConfigError, DecodeError};
use crate::message::{ENQ, PosePacket};
use decoder::{HandshakeDecoder, StreamItem};
use machine::{Action, Enquiry, Input, WorkstationMachine};

/// The graphics workstation that draws the arm (§5, §9.4): requests one pose at a time.
///
/// The order of calls is the [`Session`](robot_session::Session)'s; [`draw`](Self::draw) in every display cycle, after the
/// arrived bytes were passed in.
///
/// - **Credit of one.** It sends a request in the first display cycle of a connection, and then only after an answer. Every
///   request has one outcome: [`Pose`](WorkstationEvent::Pose) or [`Missed`](WorkstationEvent::Missed). No request is sent
///   before the outcomes of the previous ones are polled.
/// - **An answer that does not come.** After [`stale_after`](WorkstationConfig::stale_after) the request is missed and the
///   picture is [`Stale`](WorkstationEvent::Stale), and nothing is sent until the operator pauses the display for
///   [`pause`](WorkstationConfig::pause): the next display cycle then sends a request again. A host that is off would
///   otherwise find a pile of requests. An answer that comes later is [`Unasked`](WorkstationEvent::Unasked), and the next
///   display cycle sends a request again.
/// - **XOFF** holds the next request until XON, or until [`max_hold`](WorkstationConfig::max_hold) is over.
/// - **Corrupt bytes** are an event, and the next packet is still read. A whole line that cannot be read was the answer.
/// - **Life.** A request ends with its connection, and the picture is stale then.
#[derive(Debug, Clone)]
pub struct Workstation {
    core: CoreOf<Self>,
    echo: Echo<1>,
}

/// An event of the workstation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "event", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum WorkstationEvent {
    /// The answer to a request: draw it.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::message"))]
    Pose(PosePacket),
    /// A request without an answer: none has come for [`stale_after`](WorkstationConfig::stale_after), it could not be read,
    /// the display was paused, or the connection is lost.
    Missed,
    /// No pose has come for [`stale_after`](WorkstationConfig::stale_after), or the connection is lost: the arm may be at
    /// another position. Reported once, until a new pose comes.
    Stale,
    /// A notice: an unsolicited packet, such as the answer to a request that is missed.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::message"))]
    Unasked(PosePacket),
    /// A notice: bytes without a packet, or a corrupt packet.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Corrupt(DecodeError),
    /// A notice: no XON has come since the last XOFF, for [`max_hold`](WorkstationConfig::max_hold). Requests are sent again.
    HoldEnded,
    /// A notice: the line returns the sent bytes, and [`echo`](WorkstationConfig::echo) is off; or it is on, and other
    /// bytes came back.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Echo(EchoError),
    /// A notice: bytes came without a connection.
    Unexpected(Unexpected),
}

robot_session::counters! {
    /// The counts of a workstation.
    pub struct WorkstationStatistics {
        /// Requests sent.
        pub requests: u64,
        /// Requests with an answer.
        pub poses: u64,
        /// Requests without an answer.
        pub missed: u64,
        /// Times that the picture became stale.
        pub stale: u64,
        /// Packets that were not an answer.
        pub unasked: u64,
        /// Times that the line was held for longer than allowed.
        pub holds_ended: u64,
        /// Errors in the decoded bytes.
        pub corrupt: u64,
    }
}

impl Workstation {
    /// Creates a workstation without a connection.
    ///
    /// # Errors
    /// [`ConfigError::Pause`], [`ConfigError::StaleAfter`], [`ConfigError::MaxHold`].
    pub fn new(config: WorkstationConfig) -> Result<Self, ConfigError> {
        config.check()?;
        let core = Core::new(config, WorkstationMachine::Disconnected, HandshakeDecoder::default());
        Ok(Self { core, echo: Echo::new(config.echo) })
    }

    /// Starts a display cycle: called about five times a second while the display is on, and not while it is paused.
    pub fn draw(&mut self, now: Duration) {
        self.request(now, Input::Draw);
    }

    /// Returns the time until which the picture is not stale without a new pose; `None` if it is stale.
    pub fn live_until(&self) -> Option<Duration> {
        self.core.machine.live_until()
    }

    fn report(&mut self, outcome: WorkstationEvent) {
        let count = match outcome {
            WorkstationEvent::Pose(_) => &mut self.core.statistics.poses,
            WorkstationEvent::Missed => &mut self.core.statistics.missed,
            _ => &mut self.core.statistics.stale,
        };
        *count += 1;
        self.core.push_outcome(outcome);
    }
}

impl End for Workstation {
    type Machine = WorkstationMachine;
    type Decoder = HandshakeDecoder;
    type Events = EventQueue<WorkstationEvent, 8>;
    type Statistics = WorkstationStatistics;
    type Payload = PosePacket;

    const LINK: &'static str = "val2-viewer";
    const END: &'static str = "workstation";
    const MAX_INPUT: usize = 256;
    const MAX_TRANSMIT: usize = 1;
    /// Between a request and the next: a picture that becomes stale, the request's own, and its picture.
    const QUEUE_SPACE: QueueSpace = QueueSpace { connect: 0, read: 0, transmit: 3 };

    robot_session::core!(WorkstationEvent::Unexpected);
    robot_session::echo!(WorkstationEvent::Echo);

    fn next_input(&mut self) -> Option<(Input, Option<PosePacket>)> {
        Some(match self.core.decoder.next_frame()? {
            Ok(StreamItem::Packet(packet)) => (Input::Pose, Some(packet)),
            Ok(StreamItem::Xoff) => (Input::Xoff, None),
            Ok(StreamItem::Xon) => (Input::Xon, None),
            Err(error) => {
                self.core.statistics.corrupt += 1;
                self.core.events.push_notice(WorkstationEvent::Corrupt(error));
                (Input::Corrupt { line: error.is_line() }, None)
            }
        })
    }

    fn act(&mut self, _now: Duration, action: Action, packet: Option<PosePacket>) {
        match (action, packet) {
            (Action::Pose, Some(packet)) => self.report(WorkstationEvent::Pose(packet)),
            (Action::Unasked, Some(packet)) => {
                self.core.statistics.unasked += 1;
                self.core.events.push_notice(WorkstationEvent::Unasked(packet));
            }
            (Action::Missed, _) => self.report(WorkstationEvent::Missed),
            (Action::Stale, _) => self.report(WorkstationEvent::Stale),
            (Action::HoldEnded, _) => {
                self.core.statistics.holds_ended += 1;
                self.core.events.push_notice(WorkstationEvent::HoldEnded);
            }
            (Action::Closed { missed, stale }, _) => {
                if missed {
                    self.report(WorkstationEvent::Missed);
                }
                if stale {
                    self.report(WorkstationEvent::Stale);
                }
            }
            (Action::Sent, _) => self.core.statistics.requests += 1,
            (Action::Nothing | Action::Pose | Action::Unasked, _) => {}
        }
    }

    fn write(&mut self, _now: Duration, Enquiry: Enquiry, out: &mut [u8]) -> Option<(usize, Input)> {
        *out.first_mut()? = ENQ;
        // Noise may be one byte like it.
        self.echo.sent(&[ENQ], false);
        Some((1, Input::Sent))
    }
}
