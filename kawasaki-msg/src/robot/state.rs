//! The state of a robot: everything that decides its next step.

use core::time::Duration;

use crate::content::{FromPc, FromRobot};
use crate::numbering::AheadJobs;

/// A robot's machine. The session has the bytes, the job lines, the queue itself, the events and the statistics.
///
#[doc = include_str!("../../diagrams/robot.md")]
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Machine {
    /// The connection and the cycle in it.
    pub link: Link,
    /// The order; it outlives the connection.
    pub order: Order,
    /// The number of jobs of the order, or of the last one, that were queued.
    pub queued: u32,
    /// The count up to which all jobs are executed.
    pub executed: u32,
    /// The jobs after `executed` that are executed, if jobs overtake one another.
    pub ahead: AheadJobs,
    /// The count up to which all jobs are acknowledged.
    pub acked: u32,
    /// The jobs after `acked` that are acknowledged.
    pub acked_ahead: AheadJobs,
    /// The order that ended last; `None` since the robot's start.
    pub ended: Option<EndedOrder>,
    /// The messages that the next packet must contain.
    pub replies: Replies,
    /// The orders that may begin.
    pub starts: Starts,
}

/// The connection and the cycle in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Link {
    /// There is no connection; one is opened at a time.
    Disconnected {
        /// The time at which a connection is to be opened; [`Duration::MAX`]: never.
        connect_at: Duration,
    },
    /// A connection is being opened.
    Connecting {
        /// Whether the caller has received the event to open it.
        reported: bool,
    },
    /// Bytes can flow.
    Connected {
        /// The end whose turn it is to send.
        cycle: Cycle,
        /// The number of cycles without an answer in a row; at most [`silent_cycles`](crate::RobotConfig::silent_cycles).
        silent: u16,
        /// The number of packets of the connection that were not answered in time, less the ends that came late for them; at
        /// most [`silent_cycles`](crate::RobotConfig::silent_cycles) if that is not 0.
        unanswered: u16,
        /// Whether an answer has come: each end has the progress of the other.
        synced: bool,
        /// The time at which the status is due without any other reason.
        status_at: Duration,
        /// Whether the connection is to be closed, and the caller was not asked to yet.
        close: bool,
    },
}

/// The end whose turn it is to send.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Cycle {
    /// A packet is to be sent.
    Ready {
        /// The time at which the packet is sent.
        at: Duration,
        /// The time until which the packet waits for the rest of the answer, which a slow line delivers in pieces.
        overdue_at: Duration,
    },
    /// A packet was sent, and its answer is awaited.
    Waiting {
        /// The time before which the next packet is not sent.
        not_before: Duration,
        /// The time at which the cycle ends without an answer.
        overdue_at: Duration,
        /// Whether a message has come; half of another may be there.
        answered: bool,
    },
}

/// The order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Order {
    /// There is no order.
    Idle,
    /// An order is active.
    Active {
        /// The number of the order, from 1.
        number: u16,
        /// The stage of the order.
        stage: Stage,
    },
}

/// The stage of an order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Jobs are requested and queued.
    Intake {
        /// Whether jobs are requested.
        flow: Flow,
        /// Whether jobs are missing.
        gap: Gap,
        /// The steps taken to get the next job.
        recovery: Recovery,
    },
    /// The list is being cleared; the jobs in it are requested again.
    Clearing {
        /// The number of recovery steps taken since the last executed job.
        failures: u32,
        /// The time by which the jobs executed before the queue settled are reported; [`Duration::MAX`] before it has settled.
        reported_at: Duration,
    },
    /// No job follows; those in the queue are executed.
    Ending,
    /// The list is being cleared, and the order is then over.
    Interrupted {
        /// The time by which the jobs executed before the queue settled are reported; [`Duration::MAX`] before it has settled.
        reported_at: Duration,
    },
    /// The last recovery step has failed; the motion program must help.
    Alarm,
}

/// Whether jobs are requested.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Flow {
    /// Jobs are requested in every packet.
    Asking,
    /// Jobs are not requested before the queue has drained.
    Full,
    /// Jobs are not requested before a time.
    Held {
        /// The time from which jobs are requested again; [`Duration::MAX`]: never.
        until: Duration,
    },
}

/// A message failed: jobs are missing from here on, and the order's end does not count before they have come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Gap {
    /// No job is missing.
    Closed,
    /// The packet of the failed message: the rest of the packet is destroyed, even in a later segment.
    Rest,
    /// The missing jobs were requested again, once.
    Asked,
    /// An end came, and no job before it: the rest of the packet in another segment, or the PC has no more jobs.
    EndOnce,
    /// Jobs were requested once more. Another end is accepted.
    AskedAgain,
}

/// The steps of recovery, which are taken by the clock while nothing more is to be executed, and start again after an
/// executed job. `failures`: the number of steps taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Recovery {
    /// A job is being executed, or none was requested yet.
    Resting {
        /// The number of recovery steps taken since the last executed job.
        failures: u32,
    },
    /// All queued jobs are executed, and the next one was requested.
    Waiting {
        /// The number of recovery steps taken since the last executed job.
        failures: u32,
        /// The time at which a step is taken unless the next job has come; [`Duration::MAX`]: never.
        until: Duration,
    },
}

/// An order that is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct EndedOrder {
    /// The number of the order, from 1.
    pub order: u16,
    /// The last executed job of the order, 1 to 9999; `None` if no job was executed.
    pub executed: Option<u16>,
}

/// The messages that the next packet must contain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Replies {
    /// Whether the status is due.
    pub status: bool,
    /// Whether a pause is due: no jobs are to come for now.
    pub pause: bool,
    /// The number that answers a start: the active order, or 0 to refuse; `None` if no answer is due.
    pub start: Option<u16>,
    /// Whether the end of [`Machine::ended`] is due.
    pub end: bool,
}

/// The orders that may begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Starts {
    /// Any: over a stream nothing comes late.
    Any,
    /// Over datagrams, orders that no late datagram can name.
    New {
        /// The time before which starts are ignored; [`Duration::MAX`] before the first connection.
        ignored_until: Duration,
        /// Whether a start was read after that time, which was then extended by one exchange: the start may have waited to be
        /// read.
        drained: bool,
        /// The numbers of the orders that ended last, newest first; 0 for none. Their starts are refused.
        ended: [u16; 16],
    },
}

/// An input, as decoded by the session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// The caller has opened a connection.
    Connected,
    /// The connection is closed, or could not be opened.
    Disconnected,
    /// A deadline may have passed.
    Timeout,
    /// A message has come.
    Message {
        /// The meaning of the message.
        message: FromPc,
        /// Whether the queue can accept it: a slot is free for a job, or there is a motion task for an order.
        room: bool,
    },
    /// Bytes that are not a message.
    Corrupt,
    /// All bytes read are decoded.
    ReadEnd {
        /// Whether the bytes end between messages; false if they end inside one.
        whole: bool,
    },
    /// A job is executed.
    Executed {
        /// The number of the job, 1 to 9999.
        number: u16,
    },
    /// All cleared jobs are gone from the queue and none is being executed, or the motion task is gone.
    Settled,
    /// At most the low-water mark remains in the queue.
    Drained,
    /// The first reset of the motion program: the list.
    ClearQueue,
    /// The second reset of the motion program: the order.
    ResetOrder,
    /// The packet that was due is sent.
    Sent(SentPacket),
    /// The change of the state has been reported.
    Reported,
}

/// The packet that is due: acknowledgements, and these messages in this sequence; a filler if nothing is due. A message
/// without space waits for the next cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DuePacket {
    /// Executed jobs are acknowledged even if they are not a k-th one.
    pub all_acks: bool,
    /// The answer to a start; `None` if it is not due.
    pub start: Option<FromRobot>,
    /// The end of an order; `None` if it is not due. It waits until all jobs are acknowledged, if each job is.
    pub end: Option<FromRobot>,
    /// The status; `None` if it is not due. It waits in the same way as the end.
    pub status: Option<FromRobot>,
    /// The pause: no jobs are to come for now; `None` if it is not due.
    pub pause: Option<FromRobot>,
    /// The request for jobs, from the next one to queue; `None` if it is not due.
    pub request: Option<FromRobot>,
}

/// The contents of a packet that was sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct SentPacket {
    /// Cumulative: the increase of the number of acknowledged jobs; individual: the number of acknowledgements.
    pub acked: u32,
    /// Whether the answer to a start was in it.
    pub start: bool,
    /// Whether the end of an order was in it.
    pub end: bool,
    /// Whether the status was in it.
    pub status: bool,
    /// Whether the pause was in it.
    pub pause: bool,
    /// Whether the request for jobs was in it.
    pub request: bool,
}

/// An action for the session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// The session has nothing to do.
    Nothing,
    /// The connection begins: discard the measured time of an exchange on an earlier one.
    Connected,
    /// Put the job into the slot.
    Queue,
    /// Clear the queue but for the job that is being executed.
    Clear,
    /// The same as `Clear`: the order is over after it.
    Interrupt,
    /// The order begins, and the queue's numbers with it.
    Started,
    /// The start of an order is refused.
    Refused,
    /// No job follows the queued ones.
    Ending,
    /// The order is over: reset the queue, and report the order's progress.
    Over,
    /// The list is cleared; its jobs are requested again.
    Cleared,
    /// The queue has drained; jobs are requested again.
    Drained,
    /// A cycle has ended without an answer.
    NoReply,
    /// A step of recovery is taken.
    Step(RecoveryStep),
    /// The message is not used.
    Rejected(Rejection),
    /// The message is not used because it follows a failed message.
    Discarded,
    /// The packet that was due is recorded as sent.
    Sent,
    /// The answer to the packet is read.
    Answered,
    /// A job was executed before the list was cleared: it counts as queued.
    QueuedBefore,
}

/// A change to report to the caller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Report {
    /// A connection is to be opened.
    Connect,
    /// The connection is to be closed.
    Disconnect,
}

/// The reason that a message is not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Rejection {
    /// The message is about another order.
    WrongOrder,
    /// A job that is queued already.
    Repeated,
    /// A job before this one is missing.
    OutOfOrder,
    /// No job has this number.
    OutOfRange,
    /// A value is missing or out of bounds.
    Bad,
    /// There is no free slot for the job.
    QueueFull,
    /// An order that does not begin with job 1.
    NotFromFirst,
    /// The message is not expected now, or at this end.
    NotExpected,
    /// The end of an order of which jobs are missing.
    JobsMissing,
}

/// A step of recovery, taken when no job is executed (thesis, section 6.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum RecoveryStep {
    /// The same jobs are requested again.
    Resend,
    /// The PC is requested to pause, and no jobs are requested until the pause is over.
    Pause,
    /// The queue is cleared, and all jobs that are not executed are requested.
    Clear,
    /// The motion program stops and raises an alarm.
    Alarm,
}

impl Order {
    /// Returns the number of the order; 0 for none.
    pub const fn number(&self) -> u16 {
        if let Order::Active { number, .. } = self { *number } else { 0 }
    }
}

impl Flow {
    /// Requests jobs again if the pause is over.
    pub(super) fn end_pause(&mut self, now: Duration) {
        if matches!(self, Flow::Held { until } if now >= *until) {
            *self = Flow::Asking;
        }
    }
}

impl Recovery {
    /// Returns the number of steps taken.
    pub const fn failures(self) -> u32 {
        let (Recovery::Resting { failures } | Recovery::Waiting { failures, .. }) = self;
        failures
    }
}

impl Gap {
    /// Returns the state after a request was sent.
    pub(super) const fn asked(self) -> Self {
        match self {
            Gap::Closed => Gap::Closed,
            Gap::Rest | Gap::Asked => Gap::Asked,
            Gap::EndOnce | Gap::AskedAgain => Gap::AskedAgain,
        }
    }
}

robot_session::inputs!(
    Input:
    Message { message: FromPc::Status { .. } } as "Message(Status)",
    Message { message: FromPc::Start { .. } } as "Message(Start)",
    Message { message: FromPc::End { .. } } as "Message(End)",
    Message { message: FromPc::Interrupt { .. } } as "Message(Interrupt)",
    Message { message: FromPc::Job { .. } } as "Message(Job)",
    Message { message: FromPc::Filler } as "Message(Filler)",
    Message { message: FromPc::WrongSide } as "Message(WrongSide)",
    Message { message: FromPc::Unusable } as "Message(Unusable)",
    Corrupt,
    ReadEnd,
    Executed,
    Settled,
    Drained,
    ClearQueue,
    ResetOrder,
    Sent,
    Reported,
);
