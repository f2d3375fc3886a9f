//! The state of a PC: everything that decides what it does next.

use core::fmt;
use core::time::Duration;

use crate::content::{FromPc, FromRobot, Status};
use crate::numbering::Ahead;
use crate::phase::Phase;

/// A PC's machine, which listens without an order at first. Bytes, the lines of the jobs, the values of commands, events and statistics are the session's.
///
#[doc = include_str!("../../diagrams/pc.md")]
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub struct Machine {
    /// The connection.
    pub link: Link,
    /// The order; it outlives the connection.
    pub order: Order,
    /// How far the order, or the last one, is.
    pub count: Count,
    /// The commands that have no outcome yet.
    pub commands: Commands,
}

/// The connection.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum Link {
    /// No connection.
    #[default]
    Listening,
    /// Bytes can flow. The robot is given up if no message has come by `silent_at`; `close`: the connection is to be closed, which is
    /// not reported yet.
    Connected { silent_at: Duration, reply: Reply, robot: Known, close: bool },
}

/// Nothing is sent that the robot does not wait for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum Reply {
    /// The robot does not wait for an answer.
    Nothing,
    /// A message has come, and half of another is there.
    Receiving { contents: Contents },
    /// The answer is sent at a time.
    Due { at: Duration, contents: Contents },
}

/// What an answer has to hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Contents {
    /// The status.
    pub status: bool,
    /// The jobs from this count on.
    pub jobs_from: Option<u32>,
}

/// The order that the robot is in, as it has reported on this connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum Known {
    /// Nothing was reported.
    Nothing,
    /// This order was; 0 for none.
    In { order: u16 },
}

/// The order; its number is from 1.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum Order {
    /// No order.
    #[default]
    Idle,
    /// The robot is to take it. `refusals`: how often the robot has refused it without being in another order. `cancelled`: the caller
    /// has interrupted it; the outcome of the start that was sent is still waited for.
    Starting { number: u16, start: Start, refusals: u16, cancelled: bool },
    /// The robot is in it. `left_at`: over datagrams, when the robot is taken to have left the order, since its reports of another one
    /// may be late; [`Duration::MAX`] without such a report.
    Running { number: u16, stage: Stage, left_at: Duration },
}

/// How far a start is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum Start {
    /// It has to be sent.
    Unsent,
    /// The connection on which it was sent is lost: the robot's status shows what became of it.
    Lost,
    /// It was sent on this connection, and is answered by then, or the connection is given up. Over datagrams it is sent again, and
    /// once it is cancelled, it cannot arrive any more by then.
    Sent { answer_by: Duration },
    /// This order, another one or an old one of the same number, has to end first.
    Foreign { order: u16 },
}

/// How far an order is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Jobs are sent.
    Active,
    /// No job follows.
    Ending,
    /// The robot is to end it after the job that is being executed.
    Interrupted,
}

/// Counts of jobs: `executed <= queued <= sent`.
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub struct Count {
    /// Up to which count all are executed.
    pub executed: u32,
    /// How many the robot has queued, as far as it has reported.
    pub queued: u32,
    /// How many were ever sent.
    pub sent: u32,
    /// How many there are, once the source has shown it.
    pub total: Option<u32>,
    /// The jobs after `executed` that were executed ahead of others.
    pub ahead: Ahead,
    /// Corrupt bytes came: an acknowledgement may be lost.
    pub is_unsure: bool,
    /// What is executed or queued is not reported yet.
    pub is_news: bool,
}

/// The commands that have no outcome yet, oldest first: those in flight, then those that wait.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Commands {
    /// Sent since the robot's last packet.
    pub in_flight: u8,
    /// Not sent.
    pub waiting: u8,
}

impl Commands {
    /// How many there can be.
    pub const MAX: u8 = 4;
}

/// Messages that the session has understood, and requests of its caller. Jobs are counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum Input {
    /// A connection was accepted.
    Connected,
    /// It is closed.
    Disconnected,
    /// Time has passed.
    Timeout,
    /// A message has come.
    Message(FromRobot),
    /// Bytes that are not a message.
    Corrupt,
    /// All bytes read are understood. `whole`: they do not end inside a message.
    ReadEnd { whole: bool },
    /// The caller begins an order.
    Start { order: u16 },
    /// The caller goes on with an order that an earlier PC has begun, as that has kept it: the first `executed` jobs are known to be
    /// executed, those up to `sent` may have been sent; `total`: how many there are, if that is known.
    Resume { order: u16, executed: u32, sent: u32, total: Option<u32> },
    /// The caller ends it after what is queued.
    End,
    /// The caller ends it after the job that is being executed.
    Interrupt,
    /// The caller sends a command.
    Command,
    /// A job of an order that goes on was executed ahead of others.
    Ahead { index: u32 },
    /// The answer that was due is sent.
    Sent(Sent),
    /// What is to be reported of the state is.
    Reported,
}

/// What an answer has to hold: as much of it as finds room, in this order. What nothing is of is filler.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Answer {
    /// The index of a job: if the source does not have it, the order is done, and the answer is [`at_end`](Self::at_end).
    pub last: Option<u32>,
    /// The order; 0 for none.
    pub order: u16,
    /// The status: the last job sent as the queued one, and the last one known to be executed.
    pub status: Option<Status>,
    /// What the order asks of the robot.
    pub request: Option<FromPc>,
    /// How many commands, those that wait.
    pub commands: u8,
    /// The jobs of these places, as many as there are.
    pub jobs: Option<(u32, u32)>,
}

impl Answer {
    /// The answer that ends the order; its [`Sent::rest`] is [`Rest::End`].
    #[must_use]
    pub fn at_end(self) -> Self {
        let status = self.status.map(|status| Status { phase: Phase::Ending, ..status });
        Self { last: None, status, request: Some(FromPc::End { order: self.order }), jobs: None, ..self }
    }
}

/// What was in an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Sent {
    /// What the order asks of the robot.
    pub request: bool,
    /// How many commands.
    pub commands: u8,
    /// How many jobs.
    pub jobs: u32,
    /// Why no more of them.
    pub rest: Rest,
}

/// What became of the jobs that were due and are not in an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Rest {
    /// They have no room there, or are not worked out yet.
    #[default]
    Later,
    /// There are none: the order ends before them.
    End,
    /// The first cannot be written: no later one is ever asked for.
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
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum Action {
    /// Nothing.
    Nothing,
    /// The message is not used.
    Rejected(Rejection),
    /// The robot has accepted the order.
    Started,
    /// It has not, because of the active order, 0 for none. It is tried again.
    Refused { active: u16 },
    /// The robot does not accept jobs for now.
    Paused,
    /// A job was executed ahead of others.
    ExecutedAhead { index: u32 },
    /// The order has ended.
    Outcome { order: u16, outcome: Outcome },
    /// An answer was sent.
    Sent,
}

/// What the caller learns of the state: where it has changed again before that, as it is then.
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
    /// It was sent, and the robot has sent a packet since. No reply is defined for a command: whether it was executed is unknown.
    Transmitted,
    /// It was sent, and the connection has ended before the robot's next packet.
    Unknown,
}

/// How an order has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum Outcome {
    /// The jobs before `executed` and those ahead are executed, no others will be. `complete`: they are all jobs of the order.
    Over { executed: u32, complete: bool },
    /// The jobs before `executed` and those ahead are executed, the others up to `sent` are unknown.
    Unknown { executed: u32, sent: u32 },
    /// The robot has not taken the order, because of the active one, 0 for none, and it is not tried again.
    GivenUp { active: u16 },
}

/// Why a message is not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Rejection {
    /// It is of another order.
    WrongOrder,
    /// No job that this could mean was sent.
    OutOfOrder,
    /// It is not expected at this end.
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
    /// Its number; 0 for none.
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
