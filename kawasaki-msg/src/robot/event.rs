use robot_session::Unexpected;

use crate::error::{DecodeError, MessageError};
use crate::phase::Phase;
use crate::robot::state::RecoveryStep;

/// An event of a robot session.
///
/// Outcomes, which are never dropped: the four of an order, `Alarm` and `Command`. `Connect` and `Disconnect` wait until they
/// are polled or out of date. The others are notices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "event", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum RobotEvent {
    /// Open a connection, then call `handle_connected` or, if it fails, `handle_disconnected`.
    Connect,
    /// The PC is silent: close the connection, then call `handle_disconnected`.
    Disconnect,
    /// An order has begun; its first job is number 1.
    OrderStarted {
        /// The number of the order, from 1.
        order: u16,
    },
    /// A start was refused.
    OrderRefused {
        /// The number in the start; 0 is always refused.
        order: u16,
        /// The active order, which is the reason; 0 without one.
        active: u16,
    },
    /// No job follows the queued ones.
    OrderEnding {
        /// The number of the order, from 1.
        order: u16,
    },
    /// The order ends after the current job.
    OrderInterrupted {
        /// The number of the order, from 1.
        order: u16,
    },
    /// An order is over.
    OrderOver {
        /// The number of the order, from 1.
        order: u16,
        /// The number of executed jobs, from the first on without a gap.
        executed: u32,
    },
    /// A command that bypasses the queue: it takes effect after the current job.
    Command {
        /// The command's id in the dialect's table.
        id: u8,
        /// The command's value; `None` if its message lacks it.
        value: Option<i32>,
    },
    /// The PC has sent its status.
    PeerStatus {
        /// The order that the PC is in; 0 for none.
        order: u16,
        /// The phase of that order.
        phase: Phase,
        /// The job that was sent last, 1 to 9999; `None` before the first job.
        sent: Option<u16>,
        /// The job up to which all are known to be executed, 1 to 9999; `None` before the first job.
        executed: Option<u16>,
    },
    /// The queue is full; the PC is asked to pause.
    QueueFull {
        /// The job that was queued last, 1 to 9999; `None` before the first job.
        last: Option<u16>,
    },
    /// The queue has drained; jobs are requested again.
    QueueDrained {
        /// The number of the next requested job, 1 to 9999.
        next: u16,
    },
    /// Nothing more is to be executed, and the next job is overdue.
    Recovery {
        /// The recovery step that is taken.
        step: RecoveryStep,
        /// The number of the overdue job, 1 to 9999.
        next: u16,
    },
    /// For the motion program: stop and raise an alarm. `clear_queue` or `reset_order` ends the alarm.
    Alarm {
        /// The number of the active order, from 1.
        order: u16,
        /// The number of the overdue job, 1 to 9999.
        next: u16,
    },
    /// The queue was cleared; its jobs are requested again.
    QueueCleared {
        /// The number of the first job to come again, 1 to 9999.
        next: u16,
    },
    /// A cycle has ended without an answer.
    NoReply,
    /// Corrupt bytes; the messages around them were read.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Corrupt(DecodeError),
    /// A whole message that cannot be used. An unusable job also invalidates the rest of its packet.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Rejected(MessageError),
    /// A call that is invalid in this state; nothing has changed.
    Unexpected(Unexpected),
}

/// The outcomes of an order: started, ending, interrupted, over, and an alarm.
pub(super) const OF_ORDER: usize = 5;
