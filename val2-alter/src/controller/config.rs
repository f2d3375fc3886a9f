//! What a controller is told, and what it tells.

use core::time::Duration;

use crate::host::Unselected;
use crate::message::{ErrorCode, Exception, List, Mode, Polarity, Reply};
use crate::{Framing, Layout, Pose, Scale, timing};

/// How a [`Controller`](crate::Controller) behaves: the ALTER instruction and the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControllerConfig {
    /// The envelope.
    pub framing: Framing,
    /// The line's baud rate: the reply window opens when the request has left.
    pub baud: u32,
    /// The mode of the ALTER instruction.
    pub mode: Mode,
    /// Which way round mode bit 1 is.
    pub polarity: Polarity,
    /// The data list of the ALTER instruction.
    pub data: List,
    /// Whether the ALTER instruction names an exception subroutine; without one, an exception aborts the program.
    pub subroutine: bool,
    /// Start messages sent before giving up: three. (The source has "up to twice repeated" in one place and "after the third
    /// repetition" in another; set 4 for the second reading.)
    pub attempts: u8,
    /// What a value that a reply does not transmit means.
    pub unselected: Unselected,
    /// The robot's scaling.
    pub scale: Scale,
    /// The layout of the transformations that it sends.
    pub layout: Layout,
    /// Where the arm stands at first.
    pub home: Pose,
    /// A gap of more than this between bytes ends a frame.
    pub gap: Option<Duration>,
}

impl Default for ControllerConfig {
    /// `ALTER(0, 23)`, no subroutine, on the source's robot, with the tool pointing down in front of it.
    fn default() -> Self {
        Self {
            framing: Framing::DEFAULT,
            baud: timing::BAUD,
            mode: Mode::CUMULATIVE_23,
            polarity: Polarity::default(),
            data: List::EMPTY,
            subroutine: false,
            attempts: 3,
            unselected: Unselected::default(),
            scale: Scale::PUMA_562,
            layout: Layout::COLUMNS,
            home: Pose { n: [1.0, 0.0, 0.0], o: [0.0, -1.0, 0.0], a: [0.0, 0.0, -1.0], p: [400.0, 0.0, 0.0] },
            gap: Some(Duration::from_millis(4)),
        }
    }
}

/// What a [`Controller`](crate::Controller) tells its caller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ControllerEvent {
    /// The host accepted: standard messages follow.
    Started,
    /// The host refused: the program ends with an error.
    Refused,
    /// No start message was accepted.
    GaveUp,
    /// A reply was taken.
    Reply(Reply),
    /// A reply or an answer to a start message could not be read, or did not come; the next message says so to the host.
    BadReply(ErrorCode),
    /// The exception subroutine begins: call [`Controller::resume`](crate::Controller::resume) when it returns.
    Exception(Exception),
    /// An exception came, and there is no subroutine: the program is aborted.
    Aborted(Exception),
    /// The end message was sent: ALTER is over, the arm stands.
    Ended(ErrorCode),
}

/// What a [`Controller`](crate::Controller) has counted since it was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ControllerStats {
    /// Start messages sent.
    pub attempts: u64,
    /// Times that ALTER began.
    pub starts: u64,
    /// Standard messages sent.
    pub cycles: u64,
    /// Replies taken.
    pub replies: u64,
    /// Replies that could not be read.
    pub bad_replies: u64,
    /// Cycles without a reply: each has ended ALTER.
    pub timeouts: u64,
    /// Events that were dropped because nobody fetched them.
    pub events_lost: u64,
}
