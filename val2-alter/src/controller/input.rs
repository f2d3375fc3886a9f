//! The inputs from the session to the controller's machine, and the machine's actions for the session.

use crate::error::SessionError;
use crate::message::{ErrorCode, Exception, MotionPhase, StartCode};

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
    /// An answer to a start message.
    StartReply(StartCode),
    /// An answer to a standard message.
    Reply {
        /// The exception of the reply.
        exception: Exception,
        /// Whether the event queue has space to report it.
        has_room: bool,
    },
    /// The code of bytes that are not a message.
    Corrupt(ErrorCode),
    /// A deadline may have passed.
    Timeout,
    /// The message that was due is sent.
    Sent {
        /// The length of the message in bytes.
        len: u8,
    },
    /// The program executes its ALTER instruction.
    Start {
        /// Whether the event queue has space for its outcomes.
        has_room: bool,
    },
    /// The program ends ALTER: an end message is to be sent.
    Finish,
    /// The program runs a subroutine without an exception of the host.
    Interrupt,
    /// The program reports that the exception subroutine returns.
    Return,
}

/// An action of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// The session has nothing to do.
    Nothing,
    /// The caller's request is not possible.
    Refuse(SessionError),
    /// A new ALTER: all words are zero.
    Begin,
    /// The message that was due is recorded as sent.
    Sent(DueMessage),
    /// A reply was accepted; with an exception, its treatment.
    Take(ReplyEffect, Option<ExceptionHandling>),
    /// Reports the outcome of the start.
    Start(StartOutcome),
    /// The answer to a start message could not be read, or did not come. `None`: the start message is sent again; otherwise the
    /// outcome.
    BadStart(ErrorCode, Option<StartOutcome>),
    /// A reply could not be read: the arm is at rest.
    BadReply(ErrorCode),
    /// No reply came, which ends ALTER: the arm is at rest.
    Missing,
    /// The arm is at rest: the program ends ALTER.
    Rest,
    /// The arm is at rest, and ALTER is over.
    End(ErrorCode),
    /// Reports a message for which no window was open.
    Stray,
}

/// A message that is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DueMessage {
    /// A start message, with the error of the last answer.
    Start(ErrorCode),
    /// A standard message, with the phase and the error of the last reply.
    Motion(MotionPhase, ErrorCode),
    /// An end message, with the error of the last reply.
    End(ErrorCode),
}

/// The effect of a reply's values on the arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ReplyEffect {
    /// The values of the reply move the arm.
    Moves,
    /// The arm does not use the values of the reply.
    Rests,
}

/// The treatment of an exception.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ExceptionHandling {
    /// The exception subroutine begins.
    Subroutine(Exception),
    /// The program has no subroutine, and is aborted.
    Abort(Exception),
}

/// The outcome of a start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StartOutcome {
    /// The host accepted: standard messages follow.
    Started,
    /// The host refused: the program ends with an error.
    Refused,
    /// All attempts have failed: no start message was accepted.
    GaveUp,
}

robot_session::inputs!(
    Input:
    Bytes,
    StartReply { 0: StartCode::Accept } as "Accept",
    StartReply { 0: StartCode::Repeat } as "Repeat",
    StartReply { 0: StartCode::Refuse } as "Refuse",
    Reply { exception: Exception::None } as "Reply",
    Reply { exception: _ } as "Reply(exception)",
    Corrupt,
    Sent,
    Start,
    Finish,
    Interrupt,
    Return,
);
