use robot_session::Unexpected;

use crate::error::{DecodeError, FieldError, MessageError};
use crate::pc::state::CommandOutcome;
use crate::phase::Phase;

/// An event of a PC session. Jobs are counted from the beginning of the order, not by their numbers, which wrap.
///
/// Outcomes, which are never dropped: an `OrderRefused` that is given up, `JobUnfit`, `OrderOver`, `OutcomeUnknown` and
/// `Command`. `Disconnect` waits until it is polled or the connection has ended. Of several `Progress` only the last is
/// reported. The others are notices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "event", rename_all = "snake_case"))]
#[non_exhaustive]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum PcEvent {
    /// The robot is silent: close the connection, then call `handle_disconnected`.
    Disconnect,
    /// The robot has accepted the order.
    OrderStarted { order: u16 },
    /// The robot has refused the order because of the active one; 0 for none. `given_up`: it will not be retried.
    OrderRefused { order: u16, active: u16, given_up: bool },
    /// The number of executed jobs, from the first on, and the number of jobs that the robot has queued.
    Progress { executed: u32, queued: u32 },
    /// This job, counted from 0, was executed ahead of others. `Progress` covers it when these are executed too;
    /// [`Pc::is_executed`](crate::Pc::is_executed) covers all jobs.
    ExecutedAhead { index: u32 },
    /// This job, counted from 0, cannot be sent, because a field of it does not fit. The order ends after the jobs that the
    /// robot has queued.
    JobUnfit { order: u16, index: u32, error: FieldError },
    /// The order is over. Of the jobs sent, those from `executed` on will not be executed, apart from any that were executed
    /// ahead.
    OrderOver { order: u16, executed: u32, complete: bool },
    /// The robot no longer knows the order: it was restarted, or another client has begun another. Or it has interrupted the
    /// order, jobs may overtake one another, and the acknowledgement of one may be lost. The jobs before `executed` are executed;
    /// those up to `sent` are unknown; later ones are not executed.
    OutcomeUnknown { order: u16, executed: u32, sent: u32 },
    /// The robot does not accept jobs for now.
    Paused { queued: u32 },
    /// The robot has sent its status.
    PeerStatus { order: u16, phase: Phase, queued: Option<u16>, executed: Option<u16> },
    /// The outcome of a command.
    Command { id: u8, value: i32, outcome: CommandOutcome },
    /// Corrupt bytes; the messages around them were read.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Corrupt(DecodeError),
    /// A complete message that cannot be used; the messages around it were.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Rejected(MessageError),
    /// A call that is invalid in this state; nothing has changed.
    Unexpected(Unexpected),
}
