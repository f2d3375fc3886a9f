//! What a robot makes of a message that is read by itself.

use core::time::Duration;

use robot_session::{EventQueue, Unexpected};
use robot_work_queue::Writer;

use super::config::RobotConfig;
use super::event::RobotEvent;
use super::state::{Action, Input, Machine, Rejection};
use crate::content::{FromPc, phase};
use crate::dialect::Params;
use crate::error::MessageError;
use crate::job::{Job, Work};
use crate::message::Message;
use crate::role::{Field, Role};
use crate::statistics::RobotStatistics;

/// What a message is read with, beside the decoder that holds it.
pub(super) struct Reading<'a, 'q, W: Work, const WORDS: usize> {
    pub(super) config: &'a RobotConfig<'q>,
    pub(super) ranges: &'a W::Ranges,
    pub(super) machine: &'a mut Machine<WORDS>,
    pub(super) writer: &'a mut Writer<'q, Job<W>>,
    pub(super) events: &'a mut Events,
    pub(super) statistics: &'a mut RobotStatistics,
}

impl<W: Work, const WORDS: usize> Reading<'_, '_, W, WORDS> {
    pub(super) fn message(&mut self, now: Duration, message: &Message<'_>) -> Result<Action, Unexpected> {
        let dialect = &self.config.dialect;
        let (role, params) = match dialect.read(message) {
            Ok((role, params)) => (role, dialect.complete(role, params, self.machine.order.number())),
            Err(error) => return self.unusable(now, error),
        };
        let mut room = true;
        match role {
            Role::Job => return self.job(now, message, &params),
            // An order is begun only with room for all that it can report, and a motion task.
            Role::OrderStart => {
                room = self.events.has_room(2 * OF_ORDER) && !self.writer.is_abandoned();
            }
            Role::Status => {
                let (sent, executed) = (params.number(Field::Queued), params.number(Field::Executed));
                let order = params.number(Field::Order).unwrap_or(0);
                let phase = phase(&params);
                self.events.push_notice(RobotEvent::PeerStatus { order, phase, sent, executed });
            }
            Role::Command(id) if self.events.has_room(2 * OF_ORDER + 1) => {
                push(self.events, RobotEvent::Command { id, value: params.get(Field::Value) });
            }
            Role::Command(_) => {
                self.statistics.discarded += 1;
                self.events.push_notice(RobotEvent::Rejected(MessageError::NotExpected { role }));
            }
            _ => {}
        }
        let active = self.machine.order.number();
        let message = FromPc::read(role, &params);
        let action = self.machine.on(now, Input::Message { message, room }, self.config)?;
        let order = params.number(Field::Order).unwrap_or(0);
        match action {
            Action::Refused => self.events.push_notice(RobotEvent::OrderRefused { order, active }),
            Action::Rejected(why) => self.rejected(why, role, &params),
            Action::Discarded => self.statistics.discarded += 1,
            _ => {}
        }
        Ok(action)
    }

    fn job(&mut self, now: Duration, message: &Message<'_>, params: &Params) -> Result<Action, Unexpected> {
        let work = self.config.dialect.read_work::<W>(message, self.ranges);
        let order = params.number(Field::Order).unwrap_or(0);
        let number = params.number(Field::Number).unwrap_or(0);
        let message = FromPc::Job { order, number, good: work.is_ok() };
        let claim = self.writer.claim();
        let room = claim.is_ok();
        let queued = self.machine.queued;
        let action = self.machine.on(now, Input::Message { message, room }, self.config)?;
        if action == Action::Queue
            && let (Ok(claim), Ok(work)) = (claim, work)
        {
            claim.push(Job { order, number, work });
        }
        // One that was executed before the list was cleared counts as queued again.
        self.statistics.queued += u64::from(self.machine.queued - queued);
        match (action, work) {
            (Action::Rejected(Rejection::Bad), Err(error)) => {
                self.statistics.discarded += 1;
                self.events.push_notice(RobotEvent::Rejected(error));
            }
            (Action::Rejected(why), _) => self.rejected(why, Role::Job, params),
            (Action::Discarded, _) => self.statistics.discarded += 1,
            _ => {}
        }
        Ok(action)
    }

    /// A whole message that is none of the table's.
    #[cold]
    fn unusable(&mut self, now: Duration, error: MessageError) -> Result<Action, Unexpected> {
        let input = Input::Message { message: FromPc::Unusable, room: false };
        let action = self.machine.on(now, input, self.config)?;
        self.statistics.discarded += 1;
        if action != Action::Discarded {
            self.events.push_notice(RobotEvent::Rejected(error));
        }
        Ok(action)
    }

    #[cold]
    fn rejected(&mut self, why: Rejection, role: Role, params: &Params) {
        let number = |field| params.number(field).unwrap_or(0);
        let (found, found_order) = (number(Field::Number), number(Field::Order));
        let expected = self.config.numbering().next(self.machine.queued);
        let active = self.machine.order.number();
        let fields = self.config.dialect.entry(role).map_or(&[][..], |entry| entry.fields);
        let place = fields.iter().position(|field| *field == Field::Number).unwrap_or(0);
        let error = match why {
            Rejection::WrongOrder => MessageError::WrongOrder { active, found: found_order },
            Rejection::Repeated => MessageError::Repeated { expected, found },
            Rejection::OutOfOrder => MessageError::OutOfOrder { expected, found },
            Rejection::OutOfRange => {
                let max = i32::from(self.config.max_number);
                MessageError::OutOfRange { field: place, found: i32::from(found), min: 1, max }
            }
            Rejection::NotFromFirst => {
                MessageError::OutOfRange { field: place, found: i32::from(found), min: 1, max: 1 }
            }
            Rejection::QueueFull => MessageError::QueueFull { number: found },
            Rejection::JobsMissing => MessageError::JobsMissing { order: found_order, expected },
            Rejection::Bad | Rejection::NotExpected => MessageError::NotExpected { role },
        };
        match why {
            Rejection::Repeated => self.statistics.repeated += 1,
            _ => self.statistics.discarded += 1,
        }
        self.events.push_notice(RobotEvent::Rejected(error));
        if why == Rejection::QueueFull {
            let last = self.config.numbering().number(self.machine.queued);
            self.events.push_notice(RobotEvent::QueueFull { last });
        }
    }
}

pub(super) type Events = EventQueue<RobotEvent, 32>;

/// The outcomes of an order: started, ending, interrupted, over, and an alarm.
pub(super) const OF_ORDER: usize = 5;

/// An outcome: what it is of was begun only with room for it.
pub(super) fn push(events: &mut Events, outcome: RobotEvent) {
    let pushed = events.push_outcome(outcome);
    debug_assert!(pushed.is_ok(), "begun only with room for its outcomes");
}
