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
pub enum PcEvent {
    /// The robot is silent: close the connection, then call `handle_disconnected`.
    Disconnect,
    /// The robot has accepted the order.
    OrderStarted {
        /// The number of the order, from 1.
        order: u16,
    },
    /// The robot has refused the start of an order.
    OrderRefused {
        /// The number of the refused order, from 1.
        order: u16,
        /// The robot's active order, which is the reason; 0 if the robot cannot begin any order.
        active: u16,
        /// Whether the order is over: the start will not be retried.
        given_up: bool,
    },
    /// Jobs were executed or queued.
    Progress {
        /// The number of executed jobs, from the first on without a gap.
        executed: u32,
        /// The number of jobs that the robot has queued, executed ones included.
        queued: u32,
    },
    /// A job was executed ahead of others. `Progress` covers it when these are executed too;
    /// [`Pc::is_executed`](crate::Pc::is_executed) covers all jobs.
    ExecutedAhead {
        /// The index of the job in the order, from 0.
        index: u32,
    },
    /// A job cannot be sent, because a field of it does not fit. The order ends after the jobs that the robot has queued.
    JobUnfit {
        /// The number of the job's order, from 1.
        order: u16,
        /// The index of the job in the order, from 0.
        index: u32,
        /// The field that does not fit, and its fault.
        error: FieldError,
    },
    /// The order is over. Of the jobs sent, those from `executed` on will not be executed, apart from any that were executed
    /// ahead.
    OrderOver {
        /// The number of the order, from 1.
        order: u16,
        /// The number of executed jobs, from the first on without a gap.
        executed: u32,
        /// Whether these are all jobs of the order; false if the end of its list was not reached.
        complete: bool,
    },
    /// The robot no longer knows the order: it was restarted, or another client has begun another. Or it has interrupted the
    /// order, jobs may overtake one another, and the acknowledgement of one may be lost.
    OutcomeUnknown {
        /// The number of the order, from 1.
        order: u16,
        /// The number of jobs known to be executed, from the first on.
        executed: u32,
        /// The number of jobs sent: those from `executed` up to it are unknown, later ones are not executed.
        sent: u32,
    },
    /// The robot does not accept jobs for now.
    Paused {
        /// The number of jobs that the robot has queued, executed ones included.
        queued: u32,
    },
    /// The robot has sent its status.
    PeerStatus {
        /// The robot's active order; 0 for none.
        order: u16,
        /// The phase of that order.
        phase: Phase,
        /// The job that was queued last, 1 to 9999; `None` before the first job.
        queued: Option<u16>,
        /// The job up to which all are executed, 1 to 9999; `None` before the first job.
        executed: Option<u16>,
    },
    /// The outcome of a command.
    Command {
        /// The command's id in the dialect's table.
        id: u8,
        /// The value that the command was given.
        value: i32,
        /// The fate of the command.
        outcome: CommandOutcome,
    },
    /// Corrupt bytes; the messages around them were read.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Corrupt(DecodeError),
    /// A complete message that cannot be used; the messages around it were.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Rejected(MessageError),
    /// A call that is invalid in this state; nothing has changed.
    Unexpected(Unexpected),
}
