//! How a robot reads a single message.

use robot_work_queue::Wake;

use super::event::RobotEvent;
use super::session::Robot;
use super::state::{Input, Rejection};
use crate::content::{FromPc, phase};
use crate::dialect::{Dialect, Params};
use crate::error::MessageError;
use crate::job::{Job, Work};
use crate::message::Message;
use crate::role::{Field, Role};

/// The outcomes of an order: started, ending, interrupted, over, and an alarm.
pub(super) const OF_ORDER: usize = 5;

/// A message as it was read.
#[derive(Debug)]
pub struct Received<W> {
    role: Role,
    params: Params,
    /// A job's own fields, or why the message cannot be used.
    work: Result<Option<W>, MessageError>,
}

impl<W: Work> Received<W> {
    pub(super) fn read(
        dialect: &Dialect<'_>,
        ranges: &W::Ranges,
        active: u16,
        message: &Message<'_>,
    ) -> Self {
        match dialect.read_all(message, ranges) {
            Ok((role, params, work)) => {
                let params = dialect.complete(role, params, active);
                Self { role, params, work: work.filter(|_| role == Role::Job).transpose() }
            }
            Err(error) => Self { role: Role::Filler, params: Params::default(), work: Err(error) },
        }
    }

    pub(super) fn number(&self, field: Field) -> u16 {
        self.params.number(field).unwrap_or(0)
    }

    pub(super) fn job(self) -> Option<Job<W>> {
        let (order, number) = (self.number(Field::Order), self.number(Field::Number));
        Some(Job { order, number, work: self.work.ok()?? })
    }

    fn message(&self) -> FromPc {
        match (self.role, &self.work) {
            (Role::Job, work) => FromPc::Job {
                order: self.number(Field::Order),
                number: self.number(Field::Number),
                good: work.is_ok(),
            },
            (_, Err(_)) => FromPc::Unusable,
            (role, Ok(_)) => FromPc::read(role, &self.params),
        }
    }
}

impl<W: Work, const MESSAGE: usize, const WORDS: usize, R: Wake> Robot<'_, W, MESSAGE, WORDS, R> {
    /// The message as an input; what does not concern the machine is reported.
    pub(super) fn received(&mut self, received: Received<W>) -> (Input, Option<Received<W>>) {
        let message = received.message();
        let events = &mut self.core.events;
        let room = match (message, received.role) {
            (FromPc::Job { .. }, _) => self.jobs.writer.free() > 0,
            // An order is begun only with room for all that it can report, and a motion task.
            (FromPc::Start { .. }, _) => events.has_room(2 * OF_ORDER) && !self.jobs.writer.is_abandoned(),
            (FromPc::Status { order }, _) => {
                let (sent, executed) =
                    (received.params.number(Field::Queued), received.params.number(Field::Executed));
                let phase = phase(&received.params);
                events.push_notice(RobotEvent::PeerStatus { order, phase, sent, executed });
                true
            }
            (_, Role::Command(id)) if events.has_room(2 * OF_ORDER + 1) => {
                self.core.push_outcome(RobotEvent::Command { id, value: received.params.get(Field::Value) });
                true
            }
            (_, role @ Role::Command(_)) => {
                self.core.statistics.discarded += 1;
                events.push_notice(RobotEvent::Rejected(MessageError::NotExpected { role }));
                true
            }
            _ => true,
        };
        (Input::Message { message, room }, Some(received))
    }

    #[cold]
    pub(super) fn rejected(&mut self, why: Rejection, received: Received<W>) {
        let (found, found_order) = (received.number(Field::Number), received.number(Field::Order));
        let (machine, role) = (&self.core.machine, received.role);
        let expected = self.next();
        let last = self.core.config.numbering().number(machine.queued);
        let active = machine.order.number();
        let fields = self.dialect.entry(role).map_or(&[][..], |entry| entry.fields);
        let place = fields.iter().position(|field| *field == Field::Number).unwrap_or(0);
        let error = match (why, received.work) {
            (Rejection::Bad, Err(error)) => error,
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
