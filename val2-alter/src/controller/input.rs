//! What the session gives the controller's machine, and what the machine has it do.

use crate::error::SessionError;
use crate::message::{ErrorCode, Exception, MotionPhase, StartCode};

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
    /// An answer to a start message.
    StartReply(StartCode),
    /// An answer to a standard message.
    Reply {
        /// Its exception.
        exception: Exception,
        /// There is room to report it.
        has_room: bool,
    },
    /// Bytes that are no message, by their code.
    Corrupt(ErrorCode),
    /// Time has passed.
    Timeout,
    /// The message that was due, of this many bytes, is sent.
    Sent {
        /// Its length.
        len: u8,
    },
    /// The program executes its ALTER instruction.
    Start {
        /// There is room for its outcomes.
        has_room: bool,
    },
    /// The program ends ALTER.
    Finish,
    /// The program runs a subroutine without an exception of the host.
    Interrupt,
    /// The exception subroutine returns.
    Return,
}

/// What the controller does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// Nothing.
    Nothing,
    /// The caller's request is not possible.
    Refuse(SessionError),
    /// A new ALTER: all words are zero.
    Begin,
    /// A message was sent.
    Sent(Outgoing),
    /// A reply was taken; it may have an exception.
    Take(Taken, Option<Handling>),
    /// Reports what became of the start.
    Start(StartOutcome),
    /// The answer to a start message could not be read, or did not come: it is sent again, or that was the last one.
    BadStart(ErrorCode, Option<StartOutcome>),
    /// A reply could not be read: the arm is at rest.
    BadReply(ErrorCode),
    /// No reply came, which ends ALTER: the arm is at rest.
    Missing,
    /// The arm is at rest: the program ends ALTER.
    Rest,
    /// The same, and ALTER is over.
    End(ErrorCode),
    /// Reports a message that no window was open for.
    Stray,
}

/// A message that is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Outgoing {
    /// A start message.
    Start(ErrorCode),
    /// A standard message.
    Motion(MotionPhase, ErrorCode),
    /// An end message.
    End(ErrorCode),
}

/// What a reply does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Taken {
    /// Its values move the arm.
    Moves,
    /// The arm does not use them.
    Rests,
}

/// What becomes of an exception.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Handling {
    /// The subroutine begins.
    Subroutine(Exception),
    /// There is none: the program is aborted.
    Abort(Exception),
}

/// What became of a start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StartOutcome {
    /// The host accepted.
    Started,
    /// The host refused.
    Refused,
    /// There were enough attempts.
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
