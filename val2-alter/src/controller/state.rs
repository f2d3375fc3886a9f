//! The state of the controller's machine.

use core::time::Duration;

use crate::message::ErrorCode;

/// The state of a controller: the basis of all its decisions, and nothing else.
///
#[doc = include_str!("../../diagrams/controller.md")]
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct ControllerMachine {
    /// The phase: whether the port is open, and whether ALTER runs.
    pub phase: ControllerPhase,
    /// The time at which a silence ends the frame that has begun; `None`: no frame has begun.
    pub gap_at: Option<Duration>,
}

/// The phase of a controller.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum ControllerPhase {
    /// The port is not open.
    Disconnected,
    /// The port is open, and no ALTER runs.
    Off,
    /// The ALTER instruction is executed.
    On(Alter),
}

/// An ALTER.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Alter {
    /// The progress of the ALTER.
    pub progress: Progress,
    /// The end whose turn it is.
    pub turn: Turn,
    /// The error of the last reply, which the next message reports.
    pub error: ErrorCode,
    /// The time at which the next message is to be sent; while a window is open, not before it closes.
    pub slot: Duration,
    /// The time of the slot after `slot`.
    pub following: Duration,
}

/// The progress of an ALTER.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Progress {
    /// Start messages are sent until one is accepted or there were enough.
    Starting {
        /// The number of start messages sent.
        attempts: u8,
    },
    /// The replies move the arm.
    Running,
    /// The exception subroutine runs: the replies move nothing.
    Interrupted {
        /// Whether a message has reported the interruption.
        reported: bool,
        /// Whether the subroutine has returned.
        returned: bool,
    },
    /// The end message is to be sent.
    Ending,
}

/// The end whose turn it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Turn {
    /// The controller's: the next message waits for its slot.
    Controller,
    /// The host's: its answer is awaited.
    Host {
        /// The time at which the message has left: bytes that arrive before are not an answer to it.
        opens: Duration,
        /// The time at which the window closes.
        closes: Duration,
        /// The first error in this window; `None`: no error.
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
