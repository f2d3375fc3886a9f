//! What the robot says, and what it means for the order.

use super::{Core, PcEvent, Takeover};
use crate::dialect::{Field, Params, Role};
use crate::error::MessageError;
use crate::message::Message;
use crate::state::{OrderEvent, Phase};
use crate::timing::LATEST_DATAGRAM;

impl<S> Core<S> {
    pub(super) fn on_message(&mut self, message: &Message<'_>) {
        self.owed.heard = true;
        let read = self.config.dialect.read(message);
        if let Err(error) = read.and_then(|(role, params)| self.on_role(role, &params)) {
            self.events.push_report(PcEvent::Rejected(error));
        }
    }

    fn on_role(&mut self, role: Role, params: &Params) -> Result<(), MessageError> {
        let order = params.number(Field::Order).unwrap_or(0);
        let number = params.number(Field::Number).unwrap_or(0);
        match role {
            Role::JobAck => self.on_job_ack(order, number),
            Role::JobRequest => self.on_request(order, number),
            Role::Pause => {
                self.check_order(order)?;
                self.on_queued(params.number(Field::Queued))?;
                self.events.push_report(PcEvent::Paused { queued: self.order.queued });
                Ok(())
            }
            Role::OrderAck => {
                self.on_order_ack(order);
                Ok(())
            }
            Role::EndAck => {
                let ended = params.number(Field::Ended).unwrap_or(0);
                self.on_ended(ended, order, params.number(Field::Executed))
            }
            Role::Status => self.on_status(order, params),
            Role::Filler => Ok(()),
            Role::Job | Role::OrderStart | Role::OrderEnd | Role::OrderInterrupt | Role::Command(_) => {
                Err(MessageError::NotExpected { role })
            }
        }
    }

    /// Whether the robot speaks of our order, and can.
    fn check_order(&mut self, found: u16) -> Result<(), MessageError> {
        let active = if self.phase == Phase::Idle { 0 } else { self.order.number };
        if found != active || active == 0 {
            return Err(MessageError::WrongOrder { active, found });
        }
        self.doubt = None;
        Ok(())
    }

    /// Whether the robot has left our order, and not only an old datagram says so.
    fn has_left(&mut self) -> bool {
        let since = *self.doubt.get_or_insert(self.heard_at);
        !self.config.datagrams || self.heard_at >= since + LATEST_DATAGRAM
    }

    fn on_job_ack(&mut self, order: u16, number: u16) -> Result<(), MessageError> {
        if order != 0 && order == self.before {
            return Ok(());
        }
        self.check_order(order)?;
        let count = self.count(number)?;
        if self.config.cumulative_acks {
            self.on_executed(count);
        } else if count > self.order.executed && self.order.done.insert(number) {
            let before = self.order.executed;
            self.on_executed(before);
            if self.order.executed < count {
                self.events.push(PcEvent::ExecutedAhead { index: count - 1 });
            }
        }
        Ok(())
    }

    /// The count of the job that a number of the robot's means: from the last that is known to be executed up to the last sent.
    fn count(&self, found: u16) -> Result<u32, MessageError> {
        let (executed, sent) = (self.order.executed, self.order.sent);
        let count = executed + self.numbering.ahead(executed, found);
        if found == 0 || found > self.numbering.max() || count > sent {
            return Err(MessageError::OutOfOrder { expected: self.numbering.next(executed), found });
        }
        Ok(count)
    }

    /// All jobs up to a count are executed, and those that were executed ahead and follow it.
    fn on_executed(&mut self, count: u32) {
        let order = &mut self.order;
        while order.executed < count {
            order.done.remove(self.numbering.next(order.executed));
            order.executed += 1;
        }
        while order.executed < order.sent && order.done.remove(self.numbering.next(order.executed)) {
            order.executed += 1;
        }
        order.queued = order.queued.max(order.executed);
    }

    fn on_queued(&mut self, last: Option<u16>) -> Result<(), MessageError> {
        let count = last.map_or(Ok(self.order.executed), |number| self.count(number))?;
        self.order.queued = count;
        Ok(())
    }

    fn on_request(&mut self, order: u16, number: u16) -> Result<(), MessageError> {
        if self.phase != Phase::Active {
            // A request that was under way when the order changed.
            return if self.phase == Phase::Idle { self.check_order(order) } else { Ok(()) };
        }
        self.check_order(order)?;
        let executed = self.order.executed;
        let window = u32::from(self.numbering.max());
        let count = executed + (self.numbering.ahead(executed, number) + window - 1) % window;
        if number == 0 || number > self.numbering.max() || count > self.order.sent {
            if self.order.sent == 0 {
                // It has jobs of an order of the same number that is not this one.
                self.go(OrderEvent::Foreign);
                self.on_refusal(order);
            }
            return Err(MessageError::OutOfOrder {
                expected: self.numbering.next(self.order.sent),
                found: number,
            });
        }
        self.order.queued = count;
        self.owed.jobs = self.replies(Role::JobRequest).then_some(count);
        Ok(())
    }

    /// Whether the table defines a reply.
    fn replies(&self, role: Role) -> bool {
        self.config.dialect.entry(role).reply.is_some()
    }

    /// Our own number is acceptance only of a start that we wait for: it is also what the robot says of an order that was active
    /// before.
    fn on_order_ack(&mut self, active: u16) {
        if self.phase != Phase::Starting || self.foreign.is_some() {
            return;
        }
        if active == self.order.number {
            self.accepted();
        } else {
            self.on_refusal(active);
        }
    }

    /// The robot is in another order, or cannot take any: 0.
    fn on_refusal(&mut self, active: u16) {
        let order = self.order.number;
        let never = active != 0 && self.config.takeover == Takeover::Never;
        self.refusals = self.refusals.saturating_add(u16::from(active == 0));
        self.start_sent = None;
        let given_up = never || self.refusals > self.config.start_retries;
        if given_up {
            self.close(OrderEvent::Refused);
        } else {
            self.foreign = (active != 0).then_some(active);
        }
        self.events.push(PcEvent::OrderRefused { order, active, given_up });
    }

    fn accepted(&mut self) {
        self.go(OrderEvent::Accepted);
        self.events.push(PcEvent::OrderStarted { order: self.order.number });
    }

    fn close(&mut self, event: OrderEvent) {
        self.go(event);
        self.before = self.order.number;
        self.order.source = None;
        (self.foreign, self.refusals, self.owed.jobs, self.doubt) = (None, 0, None, None);
    }

    fn on_ended(&mut self, ended: u16, active: u16, executed: Option<u16>) -> Result<(), MessageError> {
        if self.phase == Phase::Starting {
            self.foreign = self.foreign.filter(|foreign| *foreign == active);
            return Ok(());
        }
        if self.phase == Phase::Idle || ended != self.order.number || active == ended {
            return Ok(());
        }
        self.over(executed)
    }

    /// The robot has said that our order is over, and how far it came.
    fn over(&mut self, executed: Option<u16>) -> Result<(), MessageError> {
        if let Some(number) = executed {
            let count = self.count(number)?;
            self.on_executed(count);
        }
        let (order, executed, sent) = (self.order.number, self.order.executed, self.order.sent);
        let complete = self.order.total == Some(executed);
        self.close(OrderEvent::Over);
        // Of a job that was executed ahead of others only its own acknowledgement told, and that datagram may be lost.
        if self.config.datagrams && !self.config.cumulative_acks && executed < sent {
            self.events.push(PcEvent::OutcomeUnknown { order, executed, sent });
            return Ok(());
        }
        self.events.push(PcEvent::OrderOver { order, executed, complete });
        Ok(())
    }

    fn on_status(&mut self, active: u16, params: &Params) -> Result<(), MessageError> {
        self.owed.status = self.replies(Role::Status);
        let code = params.number(Field::Phase).and_then(|code| u8::try_from(code).ok());
        let phase = code.map_or(Phase::Idle, Phase::from);
        let (queued, executed) = (params.number(Field::Queued), params.number(Field::Executed));
        if self.peer.replace((active, phase, queued, executed)) != Some((active, phase, queued, executed)) {
            self.events.push_report(PcEvent::PeerStatus { order: active, phase, queued, executed });
        }
        let order = self.order.number;
        match self.phase {
            Phase::Idle | Phase::Other(_) => Ok(()),
            Phase::Starting => {
                if self.foreign.is_some_and(|foreign| foreign != active) {
                    self.foreign = None;
                } else if self.foreign.is_none() && active == order {
                    // The acknowledgement was lost with its connection. Jobs in the queue are another order's.
                    match queued {
                        None => self.accepted(),
                        Some(_) => self.on_refusal(order),
                    }
                }
                Ok(())
            }
            Phase::Active | Phase::Ending | Phase::Interrupted | Phase::Alarm if active == order => {
                self.doubt = None;
                if let Some(number) = executed {
                    let count = self.count(number)?;
                    self.on_executed(count);
                }
                self.on_queued(queued)
            }
            Phase::Active | Phase::Ending | Phase::Interrupted | Phase::Alarm => {
                if !self.has_left() {
                    return Ok(());
                }
                if params.number(Field::Ended) == Some(order) && active == 0 {
                    return self.over(executed);
                }
                let (executed, sent) = (self.order.executed, self.order.sent);
                if executed == sent {
                    return self.over(None);
                }
                self.close(OrderEvent::Lost);
                self.events.push(PcEvent::OutcomeUnknown { order, executed, sent });
                Ok(())
            }
        }
    }
}
