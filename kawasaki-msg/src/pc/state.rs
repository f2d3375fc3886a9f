//! The state of a PC: everything that decides its next step.

use core::fmt;
use core::time::Duration;

use crate::content::{FromPc, FromRobot, Status};
use crate::numbering::AheadJobs;
use crate::phase::Phase;

/// A PC's machine, which listens without an order at first. The session has the bytes, the lines of the jobs, the values of
/// commands, the events and the statistics.
///
#[doc = include_str!("../../diagrams/pc.md")]
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub struct Machine {
    /// The connection to the robot, and the reply that is due on it.
    pub link: Link,
    /// The order; it outlives the connection.
    pub order: Order,
    /// The progress of the order, or of the last one.
    pub count: Count,
    /// The commands that have no outcome yet.
    pub commands: Commands,
}

/// The connection.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Link {
    /// There is no connection; the robot may open one.
    #[default]
    Listening,
    /// Bytes can flow.
    Connected {
        /// The time at which the robot is given up if no message has come; [`Duration::MAX`]: never.
        silent_at: Duration,
        /// The reply to the robot.
        reply: Reply,
        /// The order that the robot is in.
        robot: RobotOrder,
        /// Whether the connection is to be closed, and the caller was not asked to yet.
        close: bool,
    },
}

/// The reply to the robot: nothing is sent that it does not wait for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reply {
    /// The robot does not wait for an answer.
    Nothing,
    /// A message has come, and half of another is there.
    Receiving {
        /// The contents that the answer must have so far.
        contents: Contents,
    },
    /// The answer is due.
    Due {
        /// The time at which the answer is sent.
        at: Duration,
        /// The contents that the answer must have.
        contents: Contents,
    },
}

/// The contents that an answer must have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Contents {
    /// Whether the answer must have the PC's status.
    pub status: bool,
    /// The index of the first job to send, from 0; `None` if the robot has not requested jobs.
    pub jobs_from: Option<u32>,
}

/// The order that the robot is in, as it has reported on this connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RobotOrder {
    /// The robot has reported no order.
    Nothing,
    /// The robot has reported its order.
    In {
        /// The number of the order; 0 if the robot is in none.
        order: u16,
    },
}

/// The order; its number is from 1.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Order {
    /// There is no order.
    #[default]
    Idle,
    /// The robot is to accept the order.
    Starting {
        /// The number of the order, from 1.
        number: u16,
        /// The progress of the start.
        start: Start,
        /// The number of times that the robot has refused the start without being in another order.
        refusals: u16,
        /// Whether the caller has interrupted the order; the outcome of the start that was sent is still awaited.
        cancelled: bool,
    },
    /// The robot is in the order.
    Running {
        /// The number of the order, from 1.
        number: u16,
        /// The stage of the order.
        stage: Stage,
        /// Over datagrams, the time at which the robot is considered to have left the order, since its reports of another one
        /// may be late; [`Duration::MAX`] without such a report.
        left_at: Duration,
    },
}

/// The progress of a start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Start {
    /// The start must be sent.
    Unsent,
    /// The connection on which the start was sent is lost: the robot's status shows the outcome.
    Lost,
    /// The start was sent on this connection.
    Sent {
        /// The time by which the start is answered, or the connection is given up; [`Duration::MAX`]: never. Over datagrams the
        /// start is sent again; once it is cancelled, it cannot arrive after this time.
        answer_by: Duration,
    },
    /// Another order, or an old one with the same number, must end first.
    Foreign {
        /// The number of the order that must end.
        order: u16,
    },
}

/// The stage of an order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Jobs are sent as the robot requests them.
    Active,
    /// No job follows; those in the robot's queue are executed.
    Ending,
    /// The robot is to end the order after the job that is being executed.
    Interrupted,
}

/// Counts of jobs: `executed <= queued <= sent`.
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub struct Count {
    /// The count up to which all jobs are executed.
    pub executed: u32,
    /// The number of jobs that the robot has queued, as far as it has reported.
    pub queued: u32,
    /// The number of jobs that were ever sent.
    pub sent: u32,
    /// The number of jobs of the order; `None` until the source has shown it.
    pub total: Option<u32>,
    /// The jobs after `executed` that were executed ahead of others.
    pub ahead: AheadJobs,
    /// Whether corrupt bytes came: an acknowledgement may be lost.
    pub is_unsure: bool,
    /// Whether a change of `executed` or `queued` is not reported yet.
    pub is_news: bool,
}

/// The commands that have no outcome yet, oldest first: those in flight, then those that wait.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Commands {
    /// The number of commands sent since the robot's last packet.
    pub in_flight: u8,
    /// The number of commands not sent yet.
    pub waiting: u8,
}

impl Commands {
    /// The maximum number of commands without an outcome.
    pub const MAX: u8 = 4;
}

/// Messages that the session has decoded, and requests of its caller. Jobs are counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// A connection was accepted.
    Connected,
    /// The connection is closed.
    Disconnected,
    /// A deadline may have passed.
    Timeout,
    /// A message has come.
    Message(FromRobot),
    /// Bytes that are not a message.
    Corrupt,
    /// All bytes read are decoded.
    ReadEnd {
        /// Whether the bytes end between messages; false if they end inside one.
        whole: bool,
    },
    /// The caller begins an order.
    Start {
        /// The number of the order, from 1.
        order: u16,
    },
    /// The caller continues an order that an earlier PC has begun and stored.
    Resume {
        /// The number of the order, from 1.
        order: u16,
        /// The number of jobs known to be executed, from the first on.
        executed: u32,
        /// The number of jobs that may have been sent, `executed` or more.
        sent: u32,
        /// The number of jobs of the order; `None` if it is not known.
        total: Option<u32>,
    },
    /// The caller ends the order after the queued jobs.
    End,
    /// The caller ends the order after the job that is being executed.
    Interrupt,
    /// The caller sends a command.
    Command,
    /// A job of an order that continues was executed ahead of others.
    Ahead {
        /// The index of the job in the order, from 0.
        index: u32,
    },
    /// The answer that was due is sent.
    Sent(SentAnswer),
    /// The change of the state has been reported.
    Reported,
}

/// The contents of an answer: as many of them as fit, in this sequence. An answer without contents is a filler.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Answer {
    /// The index of a job: if the source does not have it, the order is done, and the answer is [`at_end`](Self::at_end).
    /// `None`: the order does not end with this answer.
    pub last: Option<u32>,
    /// The order; 0 for none.
    pub order: u16,
    /// The status: the last job sent as the queued one, and the last one known to be executed; `None` if it is not due.
    pub status: Option<Status>,
    /// The order's request to the robot; `None` if it is not due.
    pub request: Option<FromPc>,
    /// The number of waiting commands.
    pub commands: u8,
    /// The first job index and the end of the range, of which as many jobs are sent as exist; `None` without jobs.
    pub jobs: Option<(u32, u32)>,
}

impl Answer {
    /// Returns the answer that ends the order; its [`SentAnswer::rest`] is [`UnsentJobs::End`].
    #[must_use]
    pub fn at_end(self) -> Self {
        let status = self.status.map(|status| Status { phase: Phase::Ending, ..status });
        Self { last: None, status, request: Some(FromPc::End { order: self.order }), jobs: None, ..self }
    }
}

/// The contents of an answer that was sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct SentAnswer {
    /// Whether the order's request to the robot was in it.
    pub request: bool,
    /// The number of commands in the answer, oldest first.
    pub commands: u8,
    /// The number of jobs in the answer.
    pub jobs: u32,
    /// The reason that no more jobs were in it.
    pub rest: UnsentJobs,
}

/// The fate of the jobs that were due and are not in an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum UnsentJobs {
    /// The jobs do not fit, or are not computed yet.
    #[default]
    Later,
    /// No such jobs exist: the order ends before them.
    End,
    /// The first job cannot be written: no later one is ever requested.
    Unfit,
}

/// The reaction to an input.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Reaction {
    /// The number of commands that have an outcome, oldest first, and the outcome. They come before the action.
    pub commands: (u8, CommandOutcome),
    /// The action of the session.
    pub action: Action,
}

/// Tasks of the session. Jobs are counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// The session has nothing to do.
    Nothing,
    /// The message is not used.
    Rejected(Rejection),
    /// The robot has accepted the order.
    Started,
    /// The robot has not accepted the order. The start is sent again.
    Refused {
        /// The robot's active order, which is the reason; 0 without one.
        active: u16,
    },
    /// The robot does not accept jobs for now.
    Paused,
    /// A job was executed ahead of others.
    ExecutedAhead {
        /// The index of the job in the order, from 0.
        index: u32,
    },
    /// The order has ended, or was given up.
    Outcome {
        /// The number of the order, from 1.
        order: u16,
        /// The number of executed jobs, and the fate of the others.
        outcome: Outcome,
    },
    /// The answer that was due is recorded as sent.
    Sent,
}

/// A change to report to the caller. The event has the state at the time of the poll, not of the change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Report {
    /// The connection is to be closed.
    Disconnect,
    /// Jobs are executed or queued.
    Progress,
}

/// The outcome of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum CommandOutcome {
    /// The command was sent, and the robot has sent a packet since. No reply is defined for a command: whether it was
    /// executed is unknown.
    Transmitted,
    /// The command was sent, and the connection has ended before the robot's next packet.
    Unknown,
}

/// The outcome of an order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Outcome {
    /// The jobs before `executed` and those ahead are executed, no others will be.
    Over {
        /// The number of executed jobs, from the first on without a gap.
        executed: u32,
        /// Whether these are all jobs of the order.
        complete: bool,
    },
    /// The jobs before `executed` and those ahead are executed, the others up to `sent` are unknown.
    Unknown {
        /// The number of jobs known to be executed, from the first on.
        executed: u32,
        /// The number of jobs sent, executed ones included.
        sent: u32,
    },
    /// The robot has not accepted the order, and the start is not sent again.
    GivenUp {
        /// The robot's active order, which is the reason; 0 without one.
        active: u16,
    },
}

/// The reason that a message is not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Rejection {
    /// The message is about another order.
    WrongOrder,
    /// No job with this number was sent.
    OutOfOrder,
    /// The message is not expected at this end.
    NotExpected,
}

/// The action alone if no command has an outcome: the table of states has the machine without commands.
impl fmt::Debug for Reaction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.commands {
            (0, _) => self.action.fmt(f),
            commands => (commands, self.action).fmt(f),
        }
    }
}

impl Order {
    /// Returns the number of the order; 0 for none.
    pub const fn number(&self) -> u16 {
        match self {
            Order::Idle => 0,
            Order::Starting { number, .. } | Order::Running { number, .. } => *number,
        }
    }
}

robot_session::inputs!(
    Input:
    Message { 0: FromRobot::JobAck { .. } } as "Message(JobAck)",
    Message { 0: FromRobot::OrderAck { .. } } as "Message(OrderAck)",
    Message { 0: FromRobot::EndAck { .. } } as "Message(EndAck)",
    Message { 0: FromRobot::Status(_) } as "Message(Status)",
    Message { 0: FromRobot::Pause { .. } } as "Message(Pause)",
    Message { 0: FromRobot::Request { .. } } as "Message(Request)",
    Message { 0: FromRobot::Filler } as "Message(Filler)",
    Message { 0: FromRobot::WrongSide } as "Message(WrongSide)",
    Message { 0: FromRobot::Unusable } as "Message(Unusable)",
    Corrupt,
    ReadEnd,
    Start,
    Resume,
    End,
    Interrupt,
    Command,
    Ahead,
    Sent,
    Reported,
);
