//! Accepts or rejects a message that a robot has read.

use robot_work_queue::Wake;

use super::event::{OF_ORDER, RobotEvent};
use super::session::Robot;
use super::state::Rejection;
use crate::content::{FromPc, Status};
use crate::error::MessageError;
use crate::job::Work;
use crate::role::{Field, Role};

impl<W: Work, const MESSAGE: usize, R: Wake> Robot<'_, W, MESSAGE, R> {
    /// Returns whether there is space for the results of a message; reports messages that do not concern the machine.
    #[inline(always)]
    pub(super) fn accepts(&mut self, message: FromPc) -> bool {
        let events = &mut self.core.events;
        let received = &self.received;
        match (message, received.role) {
            (FromPc::Job { .. }, _) => self.jobs.writer.free() > 0,
            // An order begins only with free entries for all its outcomes, and with a motion task.
            (FromPc::Start { .. }, _) => events.has_room(2 * OF_ORDER) && !self.jobs.writer.is_abandoned(),
            (FromPc::Status { .. }, _) => {
                let Status { order, phase, queued: sent, executed, .. } = Status::read(&received.params);
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
        let fields = self.core.config.dialect.entry(role).map_or(&[][..], |entry| entry.fields);
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
