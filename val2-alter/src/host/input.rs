//! The inputs from the session to the host's machine, and the machine's actions for the session.

use super::config::{ExceptionOutcome, LostReason, Policy};
use crate::error::SessionError;
use crate::message::{AXES, ErrorCode, Exception, MotionPhase, StartCode};

/// An input, as decoded by the session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// The caller has opened the port.
    Connected,
    /// The caller reports that the port is gone.
    Disconnected,
    /// Bytes came; a frame may have begun that is not whole.
    Bytes {
        /// Whether a frame has begun.
        partial: bool,
    },
    /// A start message, with the configured mode or another.
    Start {
        /// Whether the message names the configured mode.
        is_expected: bool,
    },
    /// A standard message has come.
    Motion {
        /// The phase of ALTER: running or interrupted.
        phase: MotionPhase,
        /// The controller's error code for the last reply.
        error: ErrorCode,
        /// The length of the message in bytes.
        len: usize,
    },
    /// The controller has sent an end message.
    End,
    /// The bytes of a frame that is not a message.
    CorruptFrame,
    /// Bytes outside of any frame.
    Noise,
    /// A deadline may have passed.
    Timeout,
    /// The answer that was due is sent.
    Sent {
        /// Bit *i*: word *i* of the answer is not zero.
        moving: u8,
        /// Whether the answer is all zeros, and no axis moves.
        at_rest: bool,
    },
    /// The answer that was due does not end in time.
    Late,
    /// A start message is not answered, by the policy or because the event queue has no space for the outcomes of an
    /// ALTER.
    Ignored,
    /// The caller has set a target.
    Target,
    /// The caller has no target.
    NoTarget,
    /// The caller has an exception.
    Exception {
        /// The exception to send.
        exception: Exception,
        /// Whether the event queue has space for the outcome.
        has_room: bool,
    },
    /// The caller stops ALTER: the values go to zero.
    Stop,
    /// The policy for start messages from now on.
    Policy(Policy),
    /// Whether an exception subroutine is installed.
    Subroutine(bool),
}

/// An answer that could be sent. Its lengths may be greater than the real ones if these greater lengths
/// [fit](crate::host::machine::HostMachine::fits).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Draft {
    /// The length of the answer without words, in bytes on the line.
    pub bare: u8,
    /// The length of each word, in bytes on the line.
    pub words: [u8; AXES],
    /// Bit *i*: value *i* is not zero.
    pub moving: u8,
}

/// The answer to a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Answer {
    /// No answer: the start message is ignored.
    Nothing,
    /// The answer to a start message.
    Start(StartCode),
    /// The answer to a standard message.
    Reply {
        /// The course of the values.
        course: OutputMode,
        /// The exception in the reply; [`Exception::None`] without one.
        exception: Exception,
    },
}

/// The values that a reply commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum OutputMode {
    /// The values follow the caller's target.
    Target,
    /// The values go to zero.
    Zero,
    /// An offset brakes and stays.
    Hold,
    /// The controller has brought the arm to rest: nothing moves, and the next motion begins from rest.
    Rest,
}

/// The outcome of the caller's exception; `None`: it is not known yet, or there is no exception.
pub type Outcome = Option<(Exception, ExceptionOutcome)>;

/// An action of the host. It reports in the order of the fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// The session has nothing to do.
    Nothing,
    /// The caller's request is not possible.
    Refuse(SessionError),
    /// Ends the frame that has begun.
    EndFrame,
    /// A message was not answered in time: the arm is at rest.
    Missed,
    /// The target has expired, since the caller has not set another.
    Stale,
    /// A standard message to be answered.
    Asked(PreviousReply),
    /// The stop is done: the controller has read zeros.
    Stopped(PreviousReply),
    /// The outcome of the exception.
    Exception(Exception, ExceptionOutcome),
    /// ALTER has ended with an end message.
    Ended(Outcome),
    /// ALTER is over without an end message.
    Lost {
        /// Whether a message was not answered in time.
        missed: bool,
        /// The outcome of the caller's exception; `None` without one.
        outcome: Outcome,
        /// The reason that ALTER is over.
        reason: LostReason,
    },
    /// The answer to a start message was sent.
    SentStart(StartCode),
    /// A reply was sent, with an exception or [`Exception::None`].
    SentReply(Exception),
}

/// The results that a standard message shows about the previous one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct PreviousReply {
    /// Whether the previous message was not answered in time.
    pub missed: bool,
    /// Whether the previous message was read later than the longest delay that the host assumes.
    pub delayed: bool,
    /// The error if the controller could not read a reply, and whether that was the last reply: the arm did not move by it.
    /// `None` without an error.
    pub rejected: Option<(ErrorCode, bool)>,
    /// The outcome of the exception; `None` if it is not known yet, or there is no exception.
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
