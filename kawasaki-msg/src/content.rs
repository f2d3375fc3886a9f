//! What messages mean to the machines: facts, no bytes and no work of a job.

use crate::params::Params;
use crate::phase::Phase;
use crate::role::{Field, Role};

/// What the PC sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum FromPc {
    /// The PC's status: the order that it is in, 0 for none.
    Status { order: u16 },
    /// An order begins with this job number.
    Start { order: u16, first: u16 },
    /// No job follows.
    End { order: u16 },
    /// The order ends after the job that is being executed.
    Interrupt { order: u16 },
    /// A job. `good`: all its values are there and within bounds.
    Job { order: u16, number: u16, good: bool },
    /// Nothing to report, or a command that the application acts on.
    Filler,
    /// A message of the robot's: it is reported and not used.
    WrongSide,
    /// A whole message that is none of the table, or lacks values: it may have been a job.
    Unusable,
}

/// What the robot sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the fields are named by what they hold")]
pub enum FromRobot {
    /// A job is executed, or all up to it.
    JobAck { order: u16, number: u16 },
    /// The order that is active now; 0 for none.
    OrderAck { active: u16 },
    /// An order is over; up to this job all were executed.
    EndAck { ended: u16, active: u16, executed: Option<u16> },
    /// Where the robot is.
    Status(Status),
    /// No jobs for now.
    Pause { order: u16, queued: Option<u16> },
    /// The jobs from this number on.
    Request { order: u16, number: u16 },
    /// Nothing to report.
    Filler,
    /// A message of the PC's: it is reported and not used.
    WrongSide,
    /// A whole message that is none of the table, or lacks values: it may have been an acknowledgement.
    Unusable,
}

/// The robot's status.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Status {
    /// The active order; 0 for none.
    pub order: u16,
    /// How far it is.
    pub phase: Phase,
    /// The job that was queued last.
    pub queued: Option<u16>,
    /// The job up to which all are executed.
    pub executed: Option<u16>,
    /// The order that ended last; 0 for none.
    pub ended: u16,
}

/// The order that a message names; 0 for none.
fn order(params: &Params) -> u16 {
    params.number(Field::Order).unwrap_or(0)
}

impl FromPc {
    /// The meaning of a message's values; a job's own fields are not read here.
    pub fn read(role: Role, params: &Params) -> Self {
        let order = order(params);
        match role {
            Role::Status => FromPc::Status { order },
            Role::OrderStart => FromPc::Start { order, first: params.number(Field::Number).unwrap_or(0) },
            Role::OrderEnd => FromPc::End { order },
            Role::OrderInterrupt => FromPc::Interrupt { order },
            Role::Job => FromPc::Job { order, number: params.number(Field::Number).unwrap_or(0), good: true },
            Role::Filler | Role::Command(_) => FromPc::Filler,
            Role::JobAck | Role::JobRequest | Role::Pause | Role::OrderAck | Role::EndAck => {
                FromPc::WrongSide
            }
        }
    }
}

impl FromPc {
    /// The message's role and values. A status and a job have more of them than the machine knows.
    pub(crate) fn write(self) -> (Role, Params) {
        let of = |order| Params::default().with(Field::Order, order);
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
    /// What values mean.
    pub fn read(role: Role, params: &Params) -> Self {
        let order = order(params);
        let number = params.number(Field::Number).unwrap_or(0);
        let (queued, executed) = (params.number(Field::Queued), params.number(Field::Executed));
        let ended = params.number(Field::Ended).unwrap_or(0);
        match role {
            Role::JobAck => FromRobot::JobAck { order, number },
            Role::JobRequest => FromRobot::Request { order, number },
            Role::Pause => FromRobot::Pause { order, queued },
            Role::OrderAck => FromRobot::OrderAck { active: order },
            Role::EndAck => FromRobot::EndAck { ended, active: order, executed },
            Role::Status => {
                FromRobot::Status(Status { order, phase: phase(params), queued, executed, ended })
            }
            Role::Filler => FromRobot::Filler,
            Role::Job | Role::OrderStart | Role::OrderEnd | Role::OrderInterrupt | Role::Command(_) => {
                FromRobot::WrongSide
            }
        }
    }

    /// The message's role and values.
    pub(crate) fn write(self) -> (Role, Params) {
        let of = |order| Params::default().with(Field::Order, order);
        match self {
            FromRobot::JobAck { order, number } => (Role::JobAck, of(order).with(Field::Number, number)),
            FromRobot::OrderAck { active } => (Role::OrderAck, of(active)),
            FromRobot::EndAck { ended, active, executed } => {
                (Role::EndAck, of(active).with(Field::Ended, ended).with(Field::Executed, executed))
            }
            FromRobot::Status(status) => {
                let ended = (status.ended != 0).then_some(status.ended);
                let params = of(status.order).with(Field::Phase, u16::from(u8::from(status.phase)));
                let params = params.with(Field::Queued, status.queued).with(Field::Executed, status.executed);
                (Role::Status, params.with(Field::Ended, ended))
            }
            FromRobot::Pause { order, queued } => (Role::Pause, of(order).with(Field::Queued, queued)),
            FromRobot::Request { order, number } => (Role::JobRequest, of(order).with(Field::Number, number)),
            FromRobot::Filler | FromRobot::WrongSide | FromRobot::Unusable => {
                (Role::Filler, Params::default())
            }
        }
    }
}

/// The phase that a status names.
pub(crate) fn phase(params: &Params) -> Phase {
    let code = params.number(Field::Phase).and_then(|code| u8::try_from(code).ok());
    code.map_or(Phase::Idle, Phase::from)
}
