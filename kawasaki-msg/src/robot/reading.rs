//! How a robot reads a single message.

use robot_work_queue::Wake;

use super::event::RobotEvent;
use super::session::Robot;
use super::state::Rejection;
use crate::content::{FromPc, phase};
use crate::dialect::Dialect;
use crate::error::MessageError;
use crate::job::{Job, Work};
use crate::message::Message;
use crate::params::Params;
use crate::role::{Field, Role};

/// The outcomes of an order: started, ending, interrupted, over, and an alarm.
pub(super) const OF_ORDER: usize = 5;

/// The message that was read last.
#[derive(Debug)]
pub(super) struct Received<W> {
    role: Role,
    params: Params,
    /// A job's own fields.
    work: W,
    /// Why the last message that cannot be used, or the job in it, cannot be.
    error: Option<MessageError>,
}

impl<W: Work> Received<W> {
    pub(super) fn new() -> Self {
        Self { role: Role::Filler, params: Params::default(), work: W::default(), error: None }
    }

    pub(super) fn number(&self, field: Field) -> u16 {
        self.params.number(field).unwrap_or(0)
    }

    pub(super) fn job(&self) -> Job<W> {
        Job { order: self.number(Field::Order), number: self.number(Field::Number), work: self.work }
    }

    /// Reads a message, in the order that is active.
    #[inline(always)]
    pub(super) fn read(
        &mut self,
        dialect: &Dialect<'_>,
        ranges: &W::Ranges,
        active: u16,
        message: &Message<'_>,
    ) -> FromPc {
        let (entry, own) = match dialect.read_values(message, &mut self.params) {
            Ok(read) => read,
            Err(error) => {
                (self.role, self.params, self.error) = (Role::Filler, Params::default(), Some(error));
                return FromPc::Unusable;
            }
        };
        self.role = entry.role;
        dialect.complete(entry.role, &mut self.params, active);
        // A command's own fields are the application's.
        let Some(own) = own.filter(|_| entry.role == Role::Job) else {
            return FromPc::read(entry.role, &self.params);
        };
        let read = entry.read_work(message, own, ranges, &mut self.work);
        let good = read.is_ok();
        if let Err(error) = read {
            self.error = Some(error);
        }
        FromPc::Job { order: self.number(Field::Order), number: self.number(Field::Number), good }
    }
}

impl<W: Work, const MESSAGE: usize, const WORDS: usize, R: Wake> Robot<'_, W, MESSAGE, WORDS, R> {
    /// Whether there is space for what a message brings; reports what does not concern the machine.
    #[inline(always)]
    pub(super) fn accepts(&mut self, message: FromPc) -> bool {
        let events = &mut self.core.events;
        let received = &self.received;
        match (message, received.role) {
            (FromPc::Job { .. }, _) => self.jobs.writer.free() > 0,
            // An order is begun only with space for all that it can report, and a motion task.
            (FromPc::Start { .. }, _) => events.has_room(2 * OF_ORDER) && !self.jobs.writer.is_abandoned(),
            (FromPc::Status { order }, _) => {
                let (sent, executed) =
                    (received.params.number(Field::Queued), received.params.number(Field::Executed));
                let phase = phase(&received.params);
                events.push_notice(RobotEvent::PeerStatus { order, phase, sent, executed });
                true
            }
            (_, Role::Command(id)) if events.has_room(2 * OF_ORDER + 1) => {
                let value = received.params.get(Field::Value);
                self.core.push_outcome(RobotEvent::Command { id, value });
                true
            }
            (_, role @ Role::Command(_)) => {
                self.core.statistics.discarded += 1;
                events.push_notice(RobotEvent::Rejected(MessageError::NotExpected { role }));
                true
            }
            _ => true,
        }
    }

    #[cold]
    pub(super) fn rejected(&mut self, why: Rejection) {
        let received = &self.received;
        let (found, found_order) = (received.number(Field::Number), received.number(Field::Order));
        let (machine, role) = (&self.core.machine, received.role);
        let expected = self.next();
        let last = self.core.config.numbering().number(machine.queued);
        let active = machine.order.number();
        let fields = self.dialect.entry(role).map_or(&[][..], |entry| entry.fields);
        let place = fields.iter().position(|field| *field == Field::Number).unwrap_or(0);
        let error = match (why, received.error) {
            (Rejection::Bad, Some(error)) => error,
            (Rejection::WrongOrder, _) => MessageError::WrongOrder { active, found: found_order },
            (Rejection::Repeated, _) => MessageError::Repeated { expected, found },
            (Rejection::OutOfOrder, _) => MessageError::OutOfOrder { expected, found },
            (Rejection::OutOfRange, _) => {
                let max = i32::from(self.core.config.max_number);
                MessageError::OutOfRange { field: place, found: i32::from(found), min: 1, max }
            }
            (Rejection::NotFromFirst, _) => {
                MessageError::OutOfRange { field: place, found: i32::from(found), min: 1, max: 1 }
            }
            (Rejection::QueueFull, _) => MessageError::QueueFull { number: found },
            (Rejection::JobsMissing, _) => MessageError::JobsMissing { order: found_order, expected },
            (Rejection::Bad | Rejection::NotExpected, _) => MessageError::NotExpected { role },
        };
        match why {
            Rejection::Repeated => self.core.statistics.repeated += 1,
            _ => self.core.statistics.discarded += 1,
        }
        self.core.events.push_notice(RobotEvent::Rejected(error));
        if why == Rejection::QueueFull {
            self.core.events.push_notice(RobotEvent::QueueFull { last });
        }
    }
}
