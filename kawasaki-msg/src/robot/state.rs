//! The state of a robot: everything that decides what it does next.

use core::time::Duration;

use crate::content::{FromPc, FromRobot};
use crate::numbering::{ALL_NUMBERS, NumberSet};

/// A robot's machine. Bytes, job lines, the queue itself, events and statistics are the session's.
///
/// `WORDS` is how many job numbers it can tell apart, by 64: all of them, or fewer for a model.
///
#[doc = include_str!("../../diagrams/robot.md")]
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Machine<const WORDS: usize = ALL_NUMBERS> {
    /// The connection and the cycle in it.
    pub link: Link,
    /// The order; it outlives the connection.
    pub order: Order,
    /// How many jobs of the order, or of the last one, were queued.
    pub queued: u32,
    /// Up to which count they are executed.
    pub executed: u32,
    /// What of that the PC has not received yet.
    pub acks: AckState<WORDS>,
    /// The order that ended last.
    pub ended: Option<Ended>,
    /// What the next packet has to hold.
    pub replies: Replies,
    /// Which orders may begin.
    pub starts: Starts,
}

/// The connection and the cycle in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Link {
    /// There is none.
    Disconnected {
        /// When one is to be opened.
        connect_at: Duration,
    },
    /// One is being opened.
    Connecting {
        /// That it is to be opened is reported.
        reported: bool,
    },
    /// Bytes can flow.
    Connected {
        /// Whose turn it is to send.
        cycle: Cycle,
        /// Cycles without an answer, in a row.
        silent: u16,
        /// Packets of the connection that were not answered in time, less the ends that came late for them: at most
        /// [`silent_cycles`](super::machine::Config::silent_cycles), where that is not 0.
        unanswered: u16,
        /// An answer has come: both ends know where the other one is.
        synced: bool,
        /// When the status is due without any other reason.
        status_at: Duration,
        /// It is to be closed, which is not reported yet.
        close: bool,
    },
}

/// Whose turn it is to send.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Cycle {
    /// A packet is sent at this time.
    Ready {
        /// When.
        at: Duration,
        /// Until then it waits for what follows of the answer: a slow line brings it in pieces.
        overdue_at: Duration,
    },
    /// A packet was sent, and its answer is awaited.
    Waiting {
        /// The next packet is not sent before.
        not_before: Duration,
        /// There is no answer any more.
        overdue_at: Duration,
        /// A message has come, but half of another may be there.
        answered: bool,
    },
}

/// The order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Order {
    /// There is none.
    Idle,
    /// There is one.
    Active {
        /// Its number, from 1.
        number: u16,
        /// How far it is.
        stage: Stage,
    },
}

/// How far an order is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Jobs are asked for and queued.
    Intake {
        /// Whether jobs are asked for.
        flow: Flow,
        /// Whether jobs are missing.
        gap: Gap,
        /// What is done if no job is executed.
        recovery: Recovery,
    },
    /// The list is being cleared; what was in it is asked for again.
    Clearing {
        /// The steps of recovery that were taken.
        failures: u32,
        /// The queue has settled, and what was executed until then is reported by this time; [`Duration::MAX`] before.
        reported_at: Duration,
    },
    /// No job follows; those in the queue are executed.
    Ending,
    /// The list is being cleared, the order is over then.
    Interrupted {
        /// As in [`Stage::Clearing`].
        reported_at: Duration,
    },
    /// The recovery has come to its end; the motion program has to help.
    Alarm,
}

/// Whether jobs are asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Flow {
    /// In every packet.
    Asking,
    /// Not before the queue has drained.
    Full,
    /// Not before a time.
    Held {
        /// When.
        until: Duration,
    },
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

/// Steps of recovery: taken by the clock while nothing is left to execute, forgotten with an executed job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Recovery {
    /// Something is being executed, or nothing was asked for yet.
    Resting {
        /// The steps taken.
        failures: u32,
    },
    /// All that was queued is executed, and the next job was asked for.
    Waiting {
        /// The steps taken.
        failures: u32,
        /// The next step is taken unless the job has come by then.
        until: Duration,
    },
}

/// What is executed and not acknowledged yet.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum AckState<const WORDS: usize = ALL_NUMBERS> {
    /// An acknowledgement covers all before it.
    Cumulative {
        /// Acknowledged up to this count.
        acked: u32,
    },
    /// Jobs overtake one another, and each is acknowledged individually.
    Individual {
        /// Executed ahead of those before them.
        ahead: NumberSet<WORDS>,
        /// Executed and not acknowledged.
        unacked: NumberSet<WORDS>,
    },
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
pub enum Starts {
    /// Any: a stream brings nothing late.
    Any,
    /// Over datagrams, those that no late datagram can name.
    New {
        /// No start is looked at before; [`Duration::MAX`] before the first connection.
        ignored_until: Duration,
        /// A start was read after that time, which is one exchange longer since: it may have waited to be read.
        drained: bool,
        /// The orders before, 0 for none.
        ended: [u16; 16],
    },
}

/// What the session has understood.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// A connection is open.
    Connected,
    /// It is closed, or could not be opened.
    Disconnected,
    /// Time has passed.
    Timeout,
    /// A message.
    Message {
        /// Which.
        message: FromPc,
        /// The queue can take what it brings: a slot is free for a job, and for an order there is a motion task.
        room: bool,
    },
    /// Bytes that are no message.
    Corrupt,
    /// All that was read is understood.
    ReadEnd {
        /// No half message is held.
        whole: bool,
    },
    /// A job is executed.
    Executed {
        /// Its number.
        number: u16,
    },
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

impl<const WORDS: usize> AckState<WORDS> {
    pub(super) fn new(individual: bool) -> Self {
        if individual {
            AckState::Individual { ahead: NumberSet::new(), unacked: NumberSet::new() }
        } else {
            AckState::Cumulative { acked: 0 }
        }
    }

    pub(super) fn is_ahead(&self, number: u16) -> bool {
        matches!(self, AckState::Individual { ahead, .. } if ahead.contains(number))
    }

    /// A new connection: the status covers what is executed in order; what was executed ahead of it may not have arrived.
    pub(super) fn repeat(&mut self, executed: u32) {
        match self {
            AckState::Cumulative { acked } => *acked = executed,
            AckState::Individual { ahead, unacked } => unacked.clone_from(ahead),
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
