//! What the session gives the host's machine, and what the machine has it do.

use super::config::{ExceptionOutcome, LostReason, Policy};
use crate::error::SessionError;
use crate::message::{AXES, ErrorCode, Exception, MotionPhase, StartCode};

/// What the session understood.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum HostInput {
    /// The port was opened.
    Connected,
    /// The port is gone.
    Disconnected,
    /// Bytes came, and a frame has begun that is not whole, or not.
    Bytes {
        /// A frame has begun.
        partial: bool,
    },
    /// A start message of so many bytes, with the configured mode or another.
    Start {
        /// It names the configured mode.
        is_expected: bool,
        /// Its length.
        len: u8,
    },
    /// A standard message of so many bytes.
    Motion {
        /// Whether ALTER is interrupted.
        phase: MotionPhase,
        /// What was wrong with the last reply.
        error: ErrorCode,
        /// Its length.
        len: u8,
    },
    /// An end message.
    End,
    /// A corrupt frame.
    CorruptFrame,
    /// Bytes outside of any frame.
    Noise,
    /// Time has passed.
    Timeout,
    /// The answer can be sent.
    Transmit(Draft),
    /// The caller has set a target.
    Target,
    /// The caller has no target.
    NoTarget,
    /// The caller has an exception.
    Exception {
        /// The code.
        exception: Exception,
        /// There is room for the outcome.
        has_room: bool,
    },
    /// The caller stops.
    Stop,
    /// How start messages are answered from now on.
    Policy(Policy),
    /// Whether an exception subroutine is installed.
    Subroutine(bool),
}

/// The answer that could be sent. Its lengths may be greater than they are where that [fits](crate::machine::HostMachine::fits).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Draft {
    /// Its length without words.
    pub bare: u8,
    /// The length of each word.
    pub words: [u8; AXES],
    /// Bit *i*: value *i* is not zero.
    pub moving: u8,
    /// No axis moves.
    pub at_rest: bool,
    /// There is room for the outcomes of an ALTER.
    pub has_room: bool,
}

/// What is to be answered: a draft is made from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Wanted {
    /// No answer: the start message is ignored.
    Nothing,
    /// The answer to a start message.
    Start(StartCode),
    /// The answer to a standard message.
    Reply {
        /// Where the values go.
        course: Course,
        /// The exception in it.
        exception: Exception,
    },
}

/// Where the values go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Course {
    /// To the caller's target.
    Target,
    /// To zero.
    Zero,
    /// An offset brakes and stays.
    Hold,
    /// The controller has brought the arm to rest: nothing moves, and what follows begins from rest.
    Rest,
}

/// What the session is to do: everything that is set, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct HostActions {
    /// End the frame that has begun.
    pub end_frame: bool,
    /// A message was not answered in time: the arm is at rest.
    pub missed: bool,
    /// The controller could not read the last reply: the arm did not move by it.
    pub rejected: Option<ErrorCode>,
    /// Report that no target came.
    pub stale: bool,
    /// Report what became of an exception.
    pub outcome: Option<(Exception, ExceptionOutcome)>,
    /// Report that the stop is done.
    pub stopped: bool,
    /// ALTER has ended with an end message.
    pub ended: bool,
    /// ALTER is over without one.
    pub lost: Option<LostReason>,
    /// Send an answer.
    pub send: Option<Answer>,
    /// The caller's request is not possible.
    pub refused: Option<SessionError>,
}

/// An answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Answer {
    /// To a start message.
    Start(StartCode),
    /// To a standard message.
    Reply {
        /// The words to send.
        select: u8,
        /// The axes that must stay at zero, because their words do not fit.
        held: u8,
        /// The exception.
        exception: Exception,
    },
}

impl HostInput {
    /// The input's name.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Connected => "connected",
            Self::Disconnected => "disconnected",
            Self::Bytes { .. } => "bytes",
            Self::Start { .. } => "start message",
            Self::Motion { phase: MotionPhase::Running, .. } => "standard message",
            Self::Motion { phase: MotionPhase::Interrupted, .. } => "standard message, interrupted",
            Self::End => "end message",
            Self::CorruptFrame => "corrupt frame",
            Self::Noise => "noise",
            Self::Timeout => "timeout",
            Self::Transmit(_) => "transmit",
            Self::Target => "target",
            Self::NoTarget => "no target",
            Self::Exception { .. } => "exception",
            Self::Stop => "stop",
            Self::Policy(_) => "policy",
            Self::Subroutine(_) => "subroutine",
        }
    }
}
