//! The state of the host's machine.

use core::time::Duration;

use super::config::Policy;
use super::deadline::ReplyDeadline;
use crate::message::{Exception, MotionPhase};

/// The state of a host: the basis of all its decisions, and nothing else. It does not contain the values of axes, only which
/// words may be other than zero.
///
#[doc = include_str!("../../diagrams/host.md")]
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct HostMachine {
    /// The phase: whether the port is open, and whether ALTER runs.
    pub phase: HostPhase,
    /// The policy for start messages.
    pub policy: Policy,
    /// Whether an exception subroutine is installed.
    pub subroutine: bool,
    /// The time at which a silence ends the frame that has begun; `None`: no frame has begun.
    pub gap_at: Option<Duration>,
}

/// The phase of a host.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum HostPhase {
    /// The port is not open.
    Disconnected,
    /// The port is open, and no ALTER runs.
    Idle,
    /// A corrupt frame came that may have been a start message.
    Repeating {
        /// The number of requests in a row to repeat the start message.
        asked: u8,
        /// The time by which the answer must leave; `None` if it was sent.
        answer: Option<ReplyDeadline>,
        /// The time at which the count restarts.
        forget_at: Duration,
    },
    /// A start message is not answered yet.
    Starting {
        /// Whether the message names the configured mode.
        is_expected: bool,
        /// The time by which the answer must leave.
        answer: ReplyDeadline,
    },
    /// A start message was accepted.
    Active(ActiveAlter),
    /// The host has stopped: no message is answered.
    Silent {
        /// The time at which the controller counts as lost.
        lost_at: Duration,
    },
}

/// An ALTER.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct ActiveAlter {
    /// The stage of the ALTER.
    pub stage: Stage,
    /// The message to be answered; `None` if the last one was.
    pub request: Option<Request>,
    /// The time at which the controller counts as lost.
    pub lost_at: Duration,
    /// Whether the values follow the caller.
    pub target: Target,
    /// The state of the caller's exception.
    pub exception: PendingException,
    /// Bit *i*: the controller may hold a word *i* that is not zero, however it treats words that are left out.
    pub kept: u8,
    /// Bit *i*: the controller may hold a word *i* that is not zero if it has read the last reply. If replies may be late: the
    /// bits of all replies since `settles_at` was set.
    pub sent: u8,
    /// If replies may be late: the time after which no reply from before it was set can arrive any more. Otherwise `None`.
    pub settles_at: Option<Duration>,
    /// Whether the last message was answered, and nothing corrupt has come since.
    pub in_sequence: bool,
}

/// The stage of an ALTER.
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
        /// Whether the last reply was all zeros, at rest.
        zeros_sent: bool,
    },
}

/// Whether the values follow the caller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Target {
    /// The caller has not set a target in this ALTER.
    Unset,
    /// A target was set, and is followed.
    Fresh {
        /// The time at which the target expires.
        until: Duration,
    },
    /// The target is too old.
    Stale,
}

/// The caller's exception.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PendingException {
    /// There is no exception.
    None,
    /// An exception to be sent with the next reply.
    Unsent(Exception),
    /// An exception that was sent with the last reply.
    Sent(Exception),
    /// An exception that was sent with the reply before the last message, which reported that no reply was read: the reply may
    /// have come late since.
    Unread {
        /// The exception that was sent.
        exception: Exception,
        /// Whether that message followed directly, and nothing corrupt has come since.
        in_sequence: bool,
    },
}

/// A standard message that is not answered yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Request {
    /// The time by which the reply must leave.
    pub due: ReplyDeadline,
    /// The phase of ALTER in the message: running or interrupted.
    pub phase: MotionPhase,
}

impl HostMachine {
    /// Creates a host without a connection.
    pub const fn new(policy: Policy, subroutine: bool) -> Self {
        Self { phase: HostPhase::Disconnected, policy, subroutine, gap_at: None }
    }

    /// Returns the time by which the answer that is due must begin to leave.
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
