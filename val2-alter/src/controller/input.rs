//! What the session gives the controller's machine, and what the machine has it do.

use crate::error::SessionError;
use crate::message::{ErrorCode, Exception, MotionPhase, StartCode};

/// What the session understood.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ControllerInput {
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
    /// The window's time has come, and all that was received was read.
    WindowClosed,
    /// The message that is due, of so many bytes, can be sent.
    Transmit {
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

/// What the session is to do: everything that is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct ControllerActions {
    /// End the frame that has begun.
    pub end_frame: bool,
    /// End the frame that has begun, then give [`ControllerInput::WindowClosed`].
    pub close_window: bool,
    /// Send the message.
    pub send: Option<Outgoing>,
    /// A new ALTER: all words are zero.
    pub restart: bool,
    /// A reply was taken, and moves the arm or does not.
    pub taken: Option<Taken>,
    /// The arm is at rest in this cycle.
    pub rest: bool,
    /// Report a reply that could not be read, or did not come.
    pub bad_reply: Option<ErrorCode>,
    /// Report an exception: the subroutine begins, or the program is aborted.
    pub exception: Option<Handling>,
    /// Report what became of the start.
    pub start: Option<StartOutcome>,
    /// Report the end of ALTER.
    pub ended: Option<ErrorCode>,
    /// Report a message that no window was open for.
    pub stray: bool,
    /// The caller's request is not possible.
    pub refused: Option<SessionError>,
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

impl ControllerInput {
    /// The input's name.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Connected => "connected",
            Self::Disconnected => "disconnected",
            Self::Bytes { .. } => "bytes",
            Self::StartReply(StartCode::Accept) => "accept",
            Self::StartReply(StartCode::Repeat) => "repeat",
            Self::StartReply(StartCode::Refuse) => "refuse",
            Self::Reply { exception: Exception::None, .. } => "reply",
            Self::Reply { .. } => "reply with an exception",
            Self::Corrupt(_) => "corrupt bytes",
            Self::Timeout => "timeout",
            Self::WindowClosed => "window closed",
            Self::Transmit { .. } => "transmit",
            Self::Start { .. } => "start",
            Self::Finish => "finish",
            Self::Interrupt => "interrupt",
            Self::Return => "return",
        }
    }
}
