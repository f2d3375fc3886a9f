//! The meaning of messages for the machines: facts, without bytes and without the work of a job.

use crate::params::Params;
use crate::phase::Phase;
use crate::role::{Field, Role};

/// A message of the PC.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum FromPc {
    /// The PC's status.
    Status {
        /// The order that the PC is in; 0 for none.
        order: u16,
    },
    /// An order begins.
    Start {
        /// The number of the order, from 1; 0 is refused.
        order: u16,
        /// The number of the first job: 1, otherwise the start is refused.
        first: u16,
    },
    /// No job follows the ones sent.
    End {
        /// The order that is to end.
        order: u16,
    },
    /// The order ends after the job that is being executed.
    Interrupt {
        /// The order that is to end.
        order: u16,
    },
    /// A job of an order.
    Job {
        /// The number of the job's order.
        order: u16,
        /// The number of the job, 1 to 9999.
        number: u16,
        /// Whether all values of the job are present and within bounds.
        good: bool,
    },
    /// Nothing to report, or a command that the application acts on.
    Filler,
    /// A message that only a robot sends: it is reported and not used.
    WrongSide,
    /// A whole message that is not in the table, or lacks values: it may have been a job.
    Unusable,
}

/// A message of the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum FromRobot {
    /// A job is executed, or all up to it.
    JobAck {
        /// The number of the job's order.
        order: u16,
        /// The number of the executed job, 1 to 9999.
        number: u16,
    },
    /// The answer to a start: the order that is active now.
    OrderAck {
        /// The active order: the one of the start if the robot has accepted it; 0 for none.
        active: u16,
    },
    /// An order is over.
    EndAck {
        /// The order that is over.
        ended: u16,
        /// The order that is active now; 0 for none.
        active: u16,
        /// The job of the ended order up to which all are executed, 1 to 9999; `None` before the first job.
        executed: Option<u16>,
    },
    /// The status of the robot.
    Status(Status),
    /// The robot does not accept jobs for now.
    Pause {
        /// The active order; 0 for none.
        order: u16,
        /// The job that was queued last, 1 to 9999; `None` before the first job.
        queued: Option<u16>,
    },
    /// The robot requests the jobs from a number on.
    Request {
        /// The active order.
        order: u16,
        /// The number of the first requested job, 1 to 9999.
        number: u16,
    },
    /// A message without content, sent if nothing else is due.
    Filler,
    /// A message that only a PC sends: it is reported and not used.
    WrongSide,
    /// A whole message that is not in the table, or lacks values: it may have been an acknowledgement.
    Unusable,
}

/// The robot's status.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Status {
    /// The active order; 0 for none.
    pub order: u16,
    /// The phase of the order.
    pub phase: Phase,
    /// The job that was queued last (robot) or sent last (PC), 1 to 9999; `None` before the first job.
    pub queued: Option<u16>,
    /// The job up to which all are executed, 1 to 9999; `None` before the first job.
    pub executed: Option<u16>,
    /// The order that ended last; 0 for none.
    pub ended: u16,
}

impl Status {
    /// Returns the values of a message.
    pub(crate) fn read(params: &Params) -> Self {
        let code = params.number(Field::Phase).and_then(|code| u8::try_from(code).ok());
        Self {
            order: params.or_zero(Field::Order),
            phase: code.map_or(Phase::Idle, Phase::from),
            queued: params.number(Field::Queued),
            executed: params.number(Field::Executed),
            ended: params.or_zero(Field::Ended),
        }
    }

    pub(crate) fn write(self) -> Params {
        of(self.order)
            .with(Field::Phase, u16::from(u8::from(self.phase)))
            .with(Field::Queued, self.queued)
            .with(Field::Executed, self.executed)
            .with(Field::Ended, (self.ended != 0).then_some(self.ended))
    }
}

/// Returns the values of a message about an order.
fn of(order: u16) -> Params {
    Params::default().with(Field::Order, order)
}

impl FromPc {
    /// Returns the meaning of a message's values; a job's own fields are not read here.
    pub fn read(role: Role, params: &Params) -> Self {
        let (order, number) = (params.or_zero(Field::Order), params.or_zero(Field::Number));
        match role {
            Role::Status => FromPc::Status { order },
            Role::OrderStart => FromPc::Start { order, first: number },
            Role::OrderEnd => FromPc::End { order },
            Role::OrderInterrupt => FromPc::Interrupt { order },
            Role::Job => FromPc::Job { order, number, good: true },
            Role::Filler | Role::Command(_) => FromPc::Filler,
            Role::JobAck | Role::JobRequest | Role::Pause | Role::OrderAck | Role::EndAck => {
                FromPc::WrongSide
            }
        }
    }

    /// Returns the message's role and values. A status and a job have more values than the machine knows.
    pub(crate) fn write(self) -> (Role, Params) {
        match self {
            FromPc::Status { order } => (Role::Status, of(order)),
            FromPc::Start { order, first } => (Role::OrderStart, of(order).with(Field::Number, first)),
            FromPc::End { order } => (Role::OrderEnd, of(order)),
            FromPc::Interrupt { order } => (Role::OrderInterrupt, of(order)),
            FromPc::Job { order, number, .. } => (Role::Job, of(order).with(Field::Number, number)),
            FromPc::Filler | FromPc::WrongSide | FromPc::Unusable => (Role::Filler, Params::default()),
        }
    }
}

impl FromRobot {
    /// Returns the meaning of a message's values.
    pub fn read(role: Role, params: &Params) -> Self {
        let (order, number) = (params.or_zero(Field::Order), params.or_zero(Field::Number));
        match role {
            Role::JobAck => FromRobot::JobAck { order, number },
            Role::JobRequest => FromRobot::Request { order, number },
            Role::Pause => FromRobot::Pause { order, queued: params.number(Field::Queued) },
            Role::OrderAck => FromRobot::OrderAck { active: order },
            Role::EndAck => {
                let (ended, executed) = (params.or_zero(Field::Ended), params.number(Field::Executed));
                FromRobot::EndAck { ended, active: order, executed }
            }
            Role::Status => FromRobot::Status(Status::read(params)),
            Role::Filler => FromRobot::Filler,
            Role::Job | Role::OrderStart | Role::OrderEnd | Role::OrderInterrupt | Role::Command(_) => {
                FromRobot::WrongSide
            }
        }
    }

    /// Returns the message's role and values.
    pub(crate) fn write(self) -> (Role, Params) {
        match self {
            FromRobot::JobAck { order, number } => (Role::JobAck, of(order).with(Field::Number, number)),
            FromRobot::OrderAck { active } => (Role::OrderAck, of(active)),
            FromRobot::EndAck { ended, active, executed } => {
                (Role::EndAck, of(active).with(Field::Ended, ended).with(Field::Executed, executed))
            }
            FromRobot::Status(status) => (Role::Status, status.write()),
            FromRobot::Pause { order, queued } => (Role::Pause, of(order).with(Field::Queued, queued)),
            FromRobot::Request { order, number } => (Role::JobRequest, of(order).with(Field::Number, number)),
            FromRobot::Filler | FromRobot::WrongSide | FromRobot::Unusable => {
                (Role::Filler, Params::default())
            }
        }
    }
}
