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
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum RobotEvent {
    /// Open a connection, then call `handle_connected` or, if it fails, `handle_disconnected`.
    Connect,
    /// The PC is silent: close the connection, then call `handle_disconnected`.
    Disconnect,
    /// An order has begun; its first job is number 1.
    OrderStarted { order: u16 },
    /// A start was refused because of the active order; 0 for none.
    OrderRefused { order: u16, active: u16 },
    /// No job follows the queued ones.
    OrderEnding { order: u16 },
    /// The order ends after the current job.
    OrderInterrupted { order: u16 },
    /// An order is over; this many jobs of it were executed.
    OrderOver { order: u16, executed: u32 },
    /// A command that bypasses the queue: it takes effect after the current job.
    Command { id: u8, value: Option<i32> },
    /// The PC has sent its status: its order, its phase, the last job sent, the last job known to be executed.
    PeerStatus { order: u16, phase: Phase, sent: Option<u16>, executed: Option<u16> },
    /// The queue is full after this job; the PC is asked to pause.
    QueueFull { last: Option<u16> },
    /// The queue has drained: jobs from this one on are requested.
    QueueDrained { next: u16 },
    /// Nothing more is to be executed, and the next job is overdue; the recovery step.
    Recovery { step: RecoveryStep, next: u16 },
    /// For the motion program: stop and raise an alarm. `clear_queue` or `reset_order` ends the alarm.
    Alarm { order: u16, next: u16 },
    /// The queue was cleared; jobs are sent again from this one on.
    QueueCleared { next: u16 },
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
