//! The state of a robot: everything that decides what it does next.

use core::time::Duration;

use crate::content::{FromPc, FromRobot};
use crate::numbering::Ahead;

/// A robot's machine. Bytes, job lines, the queue itself, events and statistics are the session's.
///
#[doc = include_str!("../../diagrams/robot.md")]
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Machine {
    /// The connection and the cycle in it.
    pub link: Link,
    /// The order; it outlives the connection.
    pub order: Order,
    /// How many jobs of the order, or of the last one, were queued.
    pub queued: u32,
    /// Up to which count they are executed.
    pub executed: u32,
    /// The jobs after `executed` that are executed, where jobs overtake one another.
    pub ahead: Ahead,
    /// Up to which count all are acknowledged.
    pub acked: u32,
    /// The jobs after `acked` that are acknowledged.
    pub acked_ahead: Ahead,
    /// The order that ended last.
    pub ended: Option<Ended>,
    /// What the next packet has to hold.
    pub replies: Replies,
    /// Which orders may begin.
    pub starts: Starts,
}

/// The connection and the cycle in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum Link {
    /// No connection; one is opened at a time.
    Disconnected { connect_at: Duration },
    /// A connection is being opened; `reported` once the caller knows of it.
    Connecting { reported: bool },
    /// Bytes can flow. The status is due at `status_at` without any other reason; `synced` after an answer: both ends know where the
    /// other one is. `silent`: cycles without an answer in a row. `unanswered`: packets of the connection that were not answered in
    /// time, less the ends that came late for them; at most [`silent_cycles`](crate::RobotConfig::silent_cycles) if that is not 0.
    /// `close`: the connection is to be closed, which is not reported yet.
    Connected { cycle: Cycle, silent: u16, unanswered: u16, synced: bool, status_at: Duration, close: bool },
}

/// Whose turn it is to send.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum Cycle {
    /// A packet is sent at a time; until `overdue_at` it waits for the rest of the answer, which a slow line brings in pieces.
    Ready { at: Duration, overdue_at: Duration },
    /// A packet was sent, and its answer is awaited until `overdue_at`; the next packet is not sent before `not_before`. `answered`: a
    /// message has come, but half of another may be there.
    Waiting { not_before: Duration, overdue_at: Duration, answered: bool },
}

/// The order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum Order {
    /// No order.
    Idle,
    /// An order; its number is from 1.
    Active { number: u16, stage: Stage },
}

/// How far an order is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum Stage {
    /// Jobs are asked for and queued.
    Intake { flow: Flow, gap: Gap, recovery: Recovery },
    /// The list is being cleared; the jobs in it are asked for again. The queue has settled, and the jobs executed until then are
    /// reported by `reported_at`; [`Duration::MAX`] before. `failures`: the steps of recovery that were taken.
    Clearing { failures: u32, reported_at: Duration },
    /// No job follows; those in the queue are executed.
    Ending,
    /// The list is being cleared, the order is over then; `reported_at` as in [`Stage::Clearing`].
    Interrupted { reported_at: Duration },
    /// The recovery has come to its end; the motion program has to help.
    Alarm,
}

/// Whether jobs are asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum Flow {
    /// In every packet.
    Asking,
    /// Not before the queue has drained.
    Full,
    /// Not before a time.
    Held { until: Duration },
}

/// A message failed: jobs are missing from here on, and the order's end does not count before they have come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Gap {
    /// None is missing.
    Closed,
    /// The packet in which it failed: the rest of it is destroyed, also in a later segment.
    Rest,
    /// Jobs were asked for again.
    Asked,
    /// An end came, and no job before it: the rest of the packet in another segment, or the PC has no more jobs.
    EndOnce,
    /// Jobs were asked for once more. Another end is obeyed.
    AskedAgain,
}

/// Steps of recovery: taken by the clock while nothing is left to execute, forgotten with an executed job. `failures` were taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum Recovery {
    /// A job is being executed, or none was asked for yet.
    Resting { failures: u32 },
    /// All queued jobs are executed, and the next one was asked for: a step is taken unless it has come by then.
    Waiting { failures: u32, until: Duration },
}

/// An order that is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Ended {
    /// Its number.
    pub order: u16,
    /// The last job of it that was executed; `None` if none was.
    pub executed: Option<u16>,
}

/// What the next packet has to hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Replies {
    /// The status.
    pub status: bool,
    /// That no jobs are to come for now.
    pub pause: bool,
    /// To a start: the order number that answers it.
    pub start: Option<u16>,
    /// The end of [`Machine::ended`].
    pub end: bool,
}

/// Which orders may begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum Starts {
    /// Any: a stream brings nothing late.
    Any,
    /// Over datagrams, those that no late datagram can name: not the `ended` ones before, 0 for none. No start is looked at before
    /// `ignored_until`, [`Duration::MAX`] before the first connection. `drained`: a start was read after that time, which is one
    /// exchange longer since: it may have waited to be read.
    New { ignored_until: Duration, drained: bool, ended: [u16; 16] },
}

/// What the session has understood.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum Input {
    /// A connection is open.
    Connected,
    /// It is closed, or could not be opened.
    Disconnected,
    /// Time has passed.
    Timeout,
    /// A message. `room`: the queue can take it: a slot is free for a job, and for an order there is a motion task.
    Message { message: FromPc, room: bool },
    /// Bytes that are not a message.
    Corrupt,
    /// All bytes read are understood. `whole`: they do not end inside a message.
    ReadEnd { whole: bool },
    /// The job of this number is executed.
    Executed { number: u16 },
    /// Whatever was cleared is gone from the queue and not being executed, or there is no motion task any more.
    Settled,
    /// At most the low-water mark is left in the queue.
    Drained,
    /// The first reset of the motion program: the list.
    ClearQueue,
    /// The second reset of the motion program: the order.
    ResetOrder,
    /// The packet that was due is sent.
    Sent(Sent),
    /// What is to be reported of the state is.
    Reported,
}

/// The packet that is due: acknowledgements, and these messages in this sequence; a filler if there is none. A message without space
/// waits for the next cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Due {
    /// Executed jobs are acknowledged even if they are not a k-th one.
    pub all_acks: bool,
    /// The answer to a start.
    pub start: Option<FromRobot>,
    /// The end of an order. It waits until all jobs are acknowledged, where each one is.
    pub end: Option<FromRobot>,
    /// The status. It waits as the end does.
    pub status: Option<FromRobot>,
    /// No jobs are to come for now.
    pub pause: Option<FromRobot>,
    /// The request for jobs.
    pub request: Option<FromRobot>,
}

/// What was in a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Sent {
    /// Cumulative: by how many jobs more than before are acknowledged; individual: this many acknowledgements.
    pub acked: u32,
    /// The answer to a start.
    pub start: bool,
    /// The end of an order.
    pub end: bool,
    /// The status.
    pub status: bool,
    /// That no jobs are to come for now.
    pub pause: bool,
    /// The request for jobs.
    pub request: bool,
}

/// What the session is to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// Nothing.
    Nothing,
    /// A connection is open.
    Connected,
    /// Put the job into the slot.
    Queue,
    /// Clear the queue but for the job that is being executed.
    Clear,
    /// The same, for the order is over after it.
    Interrupt,
    /// The order has begun: the queue's numbers too.
    Started,
    /// The start is refused.
    Refused,
    /// No job follows the queued ones.
    Ending,
    /// The order is over.
    Over,
    /// The list is cleared.
    Cleared,
    /// The queue has drained; jobs are asked for again.
    Drained,
    /// A cycle has ended without an answer.
    NoReply,
    /// A step of recovery is taken.
    Step(RecoveryStep),
    /// The message is not used.
    Rejected(Rejection),
    /// It is not used because it follows a message that failed.
    Discarded,
    /// A packet was sent.
    Sent,
    /// Its answer is read.
    Answered,
    /// A job was executed before the list was cleared: it counts as queued.
    QueuedBefore,
}

/// What the caller learns of the state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Report {
    /// A connection is to be opened.
    Connect,
    /// It is to be closed.
    Disconnect,
}

/// Why a message is not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Rejection {
    /// It is of another order.
    WrongOrder,
    /// A job that is queued already.
    Repeated,
    /// A job is missing before it.
    OutOfOrder,
    /// No job has this number.
    OutOfRange,
    /// A value is missing or out of bounds.
    Bad,
    /// There is no slot for it.
    QueueFull,
    /// An order that does not begin with job 1.
    NotFromFirst,
    /// It is not expected now, or at this end.
    NotExpected,
    /// The end of an order of which jobs are missing.
    JobsMissing,
}

/// What is done when no job is executed (thesis, section 6.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum RecoveryStep {
    /// The same jobs are asked for again.
    Resend,
    /// The PC is asked to pause, and nothing is asked for until the pause is over.
    Pause,
    /// The queue is cleared, and all that is not executed is asked for.
    Clear,
    /// The motion program stops and raises an alarm.
    Alarm,
}

impl Order {
    /// Its number; 0 for none.
    pub const fn number(&self) -> u16 {
        if let Order::Active { number, .. } = self { *number } else { 0 }
    }
}

impl Flow {
    /// Jobs are asked for again if the pause is over.
    pub(super) fn end_pause(&mut self, now: Duration) {
        if matches!(self, Flow::Held { until } if now >= *until) {
            *self = Flow::Asking;
        }
    }
}

impl Recovery {
    /// The steps taken.
    pub const fn failures(self) -> u32 {
        let (Recovery::Resting { failures } | Recovery::Waiting { failures, .. }) = self;
        failures
    }
}

impl Gap {
    /// A request was sent.
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
