//! What the controller's machine remembers.

use core::time::Duration;

use crate::message::ErrorCode;

/// The state of a controller: everything that decides what it does, and nothing else.
///
#[doc = include_str!("../../diagrams/controller.md")]
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct ControllerMachine {
    /// What is going on.
    pub phase: ControllerPhase,
    /// When a silence ends the frame that has begun.
    pub gap_at: Option<Duration>,
}

/// What is going on.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum ControllerPhase {
    /// The port is not open.
    Disconnected,
    /// No ALTER.
    Off,
    /// The ALTER instruction is executed.
    On(Alter),
}

/// An ALTER.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Alter {
    /// How far it is.
    pub progress: Progress,
    /// Whose turn it is.
    pub turn: Turn,
    /// What the next message says of the last reply.
    pub error: ErrorCode,
    /// When the next message is to be sent, while a window is open not before that closes.
    pub slot: Duration,
    /// The slot after it.
    pub following: Duration,
}

/// How far an ALTER is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Progress {
    /// Start messages are sent until one is accepted or there were enough.
    Starting {
        /// Start messages sent.
        attempts: u8,
    },
    /// The replies move the arm.
    Running,
    /// The exception subroutine runs: the replies move nothing.
    Interrupted {
        /// A message said so.
        reported: bool,
        /// The subroutine has returned.
        returned: bool,
    },
    /// The end message is to be sent.
    Ending,
}

/// Whose turn it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Turn {
    /// The controller's: the next message waits for its slot.
    Controller,
    /// The host's: its answer is awaited.
    Host {
        /// When the message has left: what arrives before is no answer to it.
        opens: Duration,
        /// When the window closes.
        closes: Duration,
        /// What was wrong first in this window.
        corrupt: Option<ErrorCode>,
    },
}

impl ControllerMachine {
    /// A controller whose port is not open.
    pub const NEW: Self = Self { phase: ControllerPhase::Disconnected, gap_at: None };

    pub(super) fn is_connected(&self) -> bool {
        self.phase != ControllerPhase::Disconnected
    }
}
