//! What the session gives the host's machine, and what the machine has it do.

use super::config::{ExceptionOutcome, LostReason, Policy};
use crate::error::SessionError;
use crate::message::{AXES, ErrorCode, Exception, MotionPhase, StartCode};

/// What the session understood.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// The port was opened.
    Connected,
    /// The port is gone.
    Disconnected,
    /// Bytes came, and a frame has begun that is not whole, or not.
    Bytes {
        /// A frame has begun.
        partial: bool,
    },
    /// A start message, with the configured mode or another.
    Start {
        /// It names the configured mode.
        is_expected: bool,
    },
    /// A standard message of this many bytes.
    Motion {
        /// Whether ALTER is interrupted.
        phase: MotionPhase,
        /// What was wrong with the last reply.
        error: ErrorCode,
        /// Its length.
        len: usize,
    },
    /// An end message.
    End,
    /// A corrupt frame.
    CorruptFrame,
    /// Bytes outside of any frame.
    Noise,
    /// Time has passed.
    Timeout,
    /// The answer was sent.
    Sent {
        /// Bit *i*: it has a word *i* that is not zero.
        moving: u8,
        /// It is all zeros, and no axis moves.
        at_rest: bool,
    },
    /// The answer that was due does not end in time.
    Late,
    /// A start message is not answered: that is the policy, or there is no room for the outcomes of an ALTER.
    Ignored,
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

/// An answer that could be sent. Its lengths may be greater than they are where that [fits](crate::host::machine::HostMachine::fits).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Draft {
    /// Its length without words.
    pub bare: u8,
    /// The length of each word.
    pub words: [u8; AXES],
    /// Bit *i*: value *i* is not zero.
    pub moving: u8,
}

/// What is to be answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Answer {
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

/// What became of the caller's exception, if that is known now.
pub type Outcome = Option<(Exception, ExceptionOutcome)>;

/// What the host does, and reports in the order of the fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// Nothing.
    Nothing,
    /// The caller's request is not possible.
    Refuse(SessionError),
    /// Ends the frame that has begun.
    EndFrame,
    /// A message was not answered in time: the arm is at rest.
    Missed,
    /// No target came.
    Stale,
    /// A standard message to be answered.
    Asked(Judged),
    /// A stop is done.
    Stopped(Judged),
    /// What became of the exception.
    Exception(Exception, ExceptionOutcome),
    /// ALTER has ended with an end message.
    Ended(Outcome),
    /// ALTER is over without one.
    Lost {
        /// A message was not answered.
        missed: bool,
        /// The exception's.
        outcome: Outcome,
        /// Why.
        reason: LostReason,
    },
    /// The answer to a start message was sent.
    SentStart(StartCode),
    /// A reply was sent, with an exception or [`Exception::None`].
    SentReply(Exception),
}

/// What a standard message says of the one before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Judged {
    /// It was not answered in time.
    pub missed: bool,
    /// It was read later than the host assumes that anything is.
    pub delayed: bool,
    /// The controller could not read a reply, and whether that was the last one: the arm did not move by it.
    pub rejected: Option<(ErrorCode, bool)>,
    /// The exception's.
    pub outcome: Outcome,
}

robot_session::inputs!(
    Input:
    Bytes,
    Start { is_expected: true } as "Start",
    Start { is_expected: false } as "Start(another mode)",
    Motion { phase: MotionPhase::Running } as "Motion",
    Motion { phase: MotionPhase::Interrupted } as "Motion(interrupted)",
    End,
    CorruptFrame,
    Noise,
    Sent,
    Late,
    Ignored,
    Target,
    NoTarget,
    Exception,
    Stop,
    Policy,
    Subroutine,
);
