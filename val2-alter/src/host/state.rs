//! What the host's machine remembers.

use core::time::Duration;

use super::config::Policy;
use super::due::Due;
use crate::message::{Exception, MotionPhase};

/// The state of a host: everything that decides what it does, and nothing else. Values of axes are not in it: it knows which
/// words may be other than zero.
///
#[doc = include_str!("../../diagrams/host.md")]
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct HostMachine {
    /// What is going on.
    pub phase: HostPhase,
    /// How start messages are answered.
    pub policy: Policy,
    /// Whether an exception subroutine is installed.
    pub subroutine: bool,
    /// When a silence ends the frame that has begun.
    pub gap_at: Option<Duration>,
}

/// What is going on.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum HostPhase {
    /// The port is not open.
    Disconnected,
    /// No ALTER.
    Idle,
    /// What may have been a start message was corrupt.
    Repeating {
        /// How often in a row it was asked for again.
        asked: u8,
        /// The answer that is due.
        answer: Option<Due>,
        /// When the count restarts.
        forget_at: Duration,
    },
    /// A start message is not answered yet.
    Starting {
        /// Whether it names the configured mode.
        is_expected: bool,
        /// The answer that is due.
        answer: Due,
    },
    /// A start message was accepted.
    Active(Active),
    /// The host has stopped: no message is answered.
    Silent {
        /// When the controller counts as lost.
        lost_at: Duration,
    },
}

/// An ALTER.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Active {
    /// How far it is.
    pub stage: Stage,
    /// The message to be answered.
    pub request: Option<Request>,
    /// When the controller counts as lost.
    pub lost_at: Duration,
    /// Whether the values follow the caller.
    pub target: Target,
    /// The caller's exception.
    pub exception: Pending,
    /// Bit *i*: the controller may hold a word *i* that is not zero, whatever it makes of words that are left out.
    pub kept: u8,
    /// The same if it has read the last reply. Where replies may be late: what any reply had since `settles_at` was set.
    pub sent: u8,
    /// Where replies may be late: when none from before it was set comes any more.
    pub settles_at: Option<Duration>,
    /// The last message was answered, and nothing corrupt has come since.
    pub in_sequence: bool,
}

/// How far an ALTER is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stage {
    /// No standard message came yet.
    Accepted,
    /// The values follow the caller.
    Running,
    /// The exception subroutine runs: the values brake.
    Interrupted,
    /// The caller has stopped: the values go to zero.
    Stopping {
        /// The last reply was all zeros, at rest.
        zeros_sent: bool,
    },
}

/// Whether the values follow the caller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Target {
    /// No target was set.
    Unset,
    /// A target was set.
    Fresh {
        /// How long it holds.
        until: Duration,
    },
    /// It is too old.
    Stale,
}

/// The caller's exception.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Pending {
    /// There is none.
    None,
    /// To be sent with the next reply.
    Unsent(Exception),
    /// Sent with the last reply.
    Sent(Exception),
    /// Sent with the reply before the last message, which said that no reply was read: it may have come late since.
    Unread {
        /// The code.
        exception: Exception,
        /// That message followed directly, and nothing corrupt has come since.
        in_sequence: bool,
    },
}

/// A standard message that is not answered yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Request {
    /// When the reply must leave.
    pub due: Due,
    /// Whether ALTER is interrupted.
    pub phase: MotionPhase,
}

impl HostMachine {
    /// A host without a connection.
    pub const fn new(policy: Policy, subroutine: bool) -> Self {
        Self { phase: HostPhase::Disconnected, policy, subroutine, gap_at: None }
    }

    /// By when the answer that is due must begin to leave.
    pub fn reply_by(&self) -> Option<Duration> {
        match &self.phase {
            HostPhase::Starting { answer, .. } | HostPhase::Repeating { answer: Some(answer), .. } => {
                Some(answer.begin_by)
            }
            HostPhase::Active(active) => active.request.map(|request| request.due.begin_by),
            HostPhase::Disconnected
            | HostPhase::Idle
            | HostPhase::Repeating { answer: None, .. }
            | HostPhase::Silent { .. } => None,
        }
    }

    #[inline]
    pub(super) fn is_connected(&self) -> bool {
        self.phase != HostPhase::Disconnected
    }
}
