use crate::error::{DecodeError, MessageError};
use crate::robot::recovery::Rung;
use crate::state::Phase;

/// What a robot session has to tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "event", rename_all = "snake_case"))]
#[non_exhaustive]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum RobotEvent {
    /// Open a connection, then call `handle_connected` or, if it fails, `handle_closed`.
    Connect,
    /// The PC is silent: close the connection, then call `handle_closed`.
    Disconnect,
    /// An order has begun; its first job is number 1.
    OrderStarted { order: u16 },
    /// A start was refused because of the active order; 0 for none.
    OrderRefused { order: u16, active: u16 },
    /// No job follows those that are queued.
    OrderEnding { order: u16 },
    /// The order ends when the job that is being executed is done.
    OrderInterrupted { order: u16 },
    /// An order is over; so many jobs of it were executed.
    OrderOver { order: u16, executed: u32 },
    /// A command past the queue: it takes effect after the job that is being executed.
    Command { id: u8, value: Option<i32> },
    /// The PC's status has changed: its order, how far it is, the last job sent, the last job known to be executed.
    PeerStatus { order: u16, phase: Phase, sent: Option<u16>, executed: Option<u16> },
    /// The queue is full behind this job; the PC is asked to pause.
    QueueFull { last: Option<u16> },
    /// The queue has drained: jobs from this one on are asked for.
    QueueDrained { next: u16 },
    /// Something is wrong with the jobs; this is done about it.
    Recovery { rung: Rung, next: u16 },
    /// For the motion program: stop and raise an alarm. `clear_queue` or `reset_order` leads out of it.
    Alarm { order: u16, next: u16 },
    /// The queue is cleared; jobs come again from this one on.
    QueueCleared { next: u16 },
    /// A cycle has ended without an answer.
    NoReply,
    /// Damaged bytes; everything around them was read.
    Damaged(DecodeError),
    /// A whole message that cannot be used; everything around it was.
    Rejected(MessageError),
}
