//! One cycle: the packet that goes out, and the messages of the answer.

use super::*;

impl Core<'_> {
    /// An answer is whole when a message has come and none is left half read.
    pub(super) fn end_cycle(&mut self, now: Duration, inside_message: bool) {
        if let Cycle::Waiting { sent, answered: true } = self.cycle
            && !inside_message
        {
            self.statistics.exchange.record(now.saturating_sub(sent));
            self.cycle = Cycle::Ready(now.max(sent + self.config.exchange));
            (self.silent, self.synced) = (0, true);
        }
    }

    pub(super) fn on_damage(&mut self, error: DecodeError) {
        self.events.push_report(RobotEvent::Damaged(error));
    }

    pub(super) fn on_message(&mut self, now: Duration, message: &Message<'_>) {
        if let Cycle::Waiting { answered, .. } = &mut self.cycle {
            *answered = true;
        }
        let dialect = &self.config.dialect;
        let (role, result) = match dialect.read(message) {
            Ok((Role::Job, params)) => (Some(Role::Job), self.queue_job(&params)),
            Ok((role, params)) => (Some(role), self.on_other(now, role, &params)),
            Err(error) => (dialect.find(message.name).map(|entry| entry.role), Err(error)),
        };
        match (role, result) {
            (_, Ok(())) => {}
            (Some(Role::Job), Err(error)) => self.on_job_error(now, error),
            (_, Err(error)) => self.events.push_report(RobotEvent::Rejected(error)),
        }
    }

    fn queue_job(&mut self, params: &Params) -> Result<(), MessageError> {
        let found = params.number(Field::Order).unwrap_or(0);
        if found != self.order || found == 0 {
            return Err(MessageError::WrongOrder { active: self.order, found });
        }
        if self.phase != Phase::Active {
            return Err(MessageError::NotExpected { role: Role::Job });
        }
        let job = params.job(&self.config.dialect, &self.config.bounds)?;
        self.intake.offer(job)?;
        self.statistics.queued += 1;
        Ok(())
    }

    /// Queues the plain jobs that come next, as far as there is room. The next message, whatever it is, is read the general way.
    pub(super) fn on_plain_jobs(&mut self, decoder: &mut Decoder) {
        let Some(plain) = self.plain.filter(|_| self.phase == Phase::Active) else { return };
        let queued = self.intake.offer_plain(decoder, &plain);
        self.statistics.queued += u64::from(queued);
        if let Cycle::Waiting { answered, .. } = &mut self.cycle {
            *answered |= queued > 0;
        }
    }

    /// The first failure of a cycle is told and acted on; the rest of the packet follows from it and is discarded.
    #[cold]
    fn on_job_error(&mut self, now: Duration, error: MessageError) {
        if let MessageError::Repeated { .. } = error {
            self.statistics.repeated += 1;
            if !core::mem::replace(&mut self.repeated, true) {
                self.events.push_report(RobotEvent::Rejected(error));
            }
            return;
        }
        self.statistics.discarded += 1;
        if core::mem::replace(&mut self.failed, true) {
            return;
        }
        self.events.push_report(RobotEvent::Rejected(error));
        match error {
            MessageError::QueueFull { .. } => self.pause(),
            _ if self.phase == Phase::Active && !self.intake.is_resetting() => self.recover(now),
            _ => {}
        }
    }

    fn pause(&mut self) {
        if !self.intake.is_resetting() && !core::mem::replace(&mut self.full, true) {
            self.owed.pause = true;
            self.events.push_report(RobotEvent::QueueFull { last: self.number(self.intake.queued()) });
        }
    }

    fn recover(&mut self, now: Duration) {
        let rung = self.recovery.fail(&self.config.ladder, self.intake.queued());
        let next = self.intake.expected();
        match rung {
            Rung::Resend => {}
            Rung::Pause => {
                self.owed.pause = true;
                self.hold_until = now + self.config.pause;
            }
            Rung::Clear => self.intake.reset(Reset::List),
            Rung::Alarm => {
                self.go(OrderEvent::Alarm);
                self.events.push(RobotEvent::Alarm { order: self.order, next });
                return;
            }
        }
        self.events.push_report(RobotEvent::Recovery { rung, next });
    }

    fn on_other(&mut self, now: Duration, role: Role, params: &Params) -> Result<(), MessageError> {
        let order = params.number(Field::Order).unwrap_or(0);
        match role {
            Role::OrderStart => return self.on_start(now, order, params.number(Field::Number)),
            Role::OrderEnd => {
                self.owe_end(order);
                if order == self.order && self.phase.on(OrderEvent::End).is_some() {
                    self.go(OrderEvent::End);
                    self.events.push(RobotEvent::OrderEnding { order });
                }
            }
            Role::OrderInterrupt => {
                self.owe_end(order);
                if order == self.order {
                    self.interrupt();
                }
            }
            Role::Status => self.on_status(order, params),
            Role::Filler => {}
            Role::Command(id) => {
                self.events.push(RobotEvent::Command { id, value: params.get(Field::Value) });
            }
            Role::Job | Role::JobAck | Role::JobRequest | Role::Pause | Role::OrderAck | Role::EndAck => {
                return Err(MessageError::NotExpected { role });
            }
        }
        Ok(())
    }

    /// "If the order went through, its number is returned, otherwise 0 or the number of the active order" (thesis, section 10.1).
    ///
    /// A late datagram may say it of an order that is over: one of a number that has just ended is refused. A robot that has just
    /// been started knows none of them, and hears no start for as long as such a datagram may still come.
    fn on_start(&mut self, now: Duration, order: u16, first: Option<u16>) -> Result<(), MessageError> {
        if self.config.datagrams && self.deaf_until.is_none_or(|until| now < until) {
            return Ok(());
        }
        let over = self.config.datagrams && self.ended_before.contains(&order);
        let possible = self.phase == Phase::Idle && order != 0 && first == Some(1);
        let accepted = possible && !over && !self.intake.is_abandoned();
        if accepted {
            self.go(OrderEvent::Start);
            self.intake.begin();
            self.order = order;
            self.plain = PlainJobs::new(&self.config.dialect, &self.config.bounds, order);
            (self.acked, self.full, self.recovery) = (0, false, Recovery::default());
            self.unacked.clear();
            self.hold_until = Duration::ZERO;
            self.go(OrderEvent::Accepted);
            self.events.push(RobotEvent::OrderStarted { order });
        }
        let again = !accepted && order == self.order && order != 0;
        let answer = if again && self.config.refuse_repeated_start && self.intake.queued() > 0 {
            0
        } else {
            self.order
        };
        self.owed.order_ack = Some(answer);
        // A refusal alone does not say how far the active order is.
        self.owed.status |= !accepted;
        if !accepted && !again {
            self.events.push(RobotEvent::OrderRefused { order, active: self.order });
        }
        match first {
            Some(first) if first != 1 => {
                Err(MessageError::OutOfRange { field: 1, found: i32::from(first), min: 1, max: 1 })
            }
            _ => Ok(()),
        }
    }

    /// The end of an order that is not active is acknowledged again if it was the last one. How far another came is not known here:
    /// the status says which orders are.
    fn owe_end(&mut self, order: u16) {
        if self.ended == Some(order) && order != self.order {
            self.owed.end_ack = Some(order);
        } else {
            self.owed.status |= order != self.order;
        }
    }

    fn on_status(&mut self, order: u16, params: &Params) {
        let code = params.number(Field::Phase).and_then(|code| u8::try_from(code).ok());
        let phase = code.map_or(Phase::Idle, Phase::from);
        let (sent, executed) = (params.number(Field::Queued), params.number(Field::Executed));
        if self.peer.replace((order, phase, sent, executed)) != Some((order, phase, sent, executed)) {
            self.events.push_report(RobotEvent::PeerStatus { order, phase, sent, executed });
        }
        if self.config.end_foreign_order && self.order != 0 && order != self.order {
            self.interrupt();
        }
    }

    pub(super) fn transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        let Cycle::Ready(at) = self.cycle else { return None };
        if self.link != Link::Connected || now < at {
            return None;
        }
        let mut packet = Packet::new(out, self.config.limits, self.config.dialect.charset());
        self.fill(now, &mut packet);
        let length = packet.as_bytes().len();
        if length == 0 {
            return None;
        }
        self.cycle = Cycle::Waiting { sent: now, answered: false };
        (self.failed, self.repeated) = (false, false);
        self.statistics.packets += 1;
        Some(length)
    }

    /// Everything there is to say, as far as it fits; filler if there is nothing. What does not fit waits for the next cycle.
    ///
    /// Acknowledgements come first: the end of an order is told behind the last of its jobs.
    fn fill(&mut self, now: Duration, packet: &mut Packet<'_>) {
        let status = self.owed.status || now >= self.status_at;
        let asks = self.synced
            && self.phase == Phase::Active
            && !self.full
            && !self.intake.is_resetting()
            && now >= self.hold_until;
        let idle = !asks && !status && !self.owed.pause && self.owed.order_ack.is_none();
        let all_told = self.acknowledge(packet, idle);
        if let Some(answer) = self.owed.order_ack
            && self.send(packet, Role::OrderAck, &Params::default().with(Field::Order, answer))
        {
            self.owed.order_ack = None;
        }
        if let Some(ended) = self.owed.end_ack.filter(|_| all_told) {
            // Another order may have begun since.
            let params = Params::default().with(Field::Ended, ended).with(Field::Order, self.order);
            if self.send(packet, Role::EndAck, &params.with(Field::Executed, self.ended_executed)) {
                self.owed.end_ack = None;
            }
        }
        if status && all_told {
            self.owed.status = !self.send(packet, Role::Status, &self.status());
            self.status_at = now + self.config.status_period;
        }
        if self.owed.pause {
            let params = self.of_order().with(Field::Queued, self.number(self.intake.queued()));
            self.owed.pause = !self.send(packet, Role::Pause, &params);
        }
        if asks {
            let params = self.of_order().with(Field::Number, self.intake.expected());
            self.send(packet, Role::JobRequest, &params);
        }
        if packet.is_empty() {
            self.send(packet, Role::Filler, &Params::default());
        }
    }

    /// Acknowledges what is executed, every k-th job or what is left "at least when there is nothing else to send" (thesis,
    /// section 11.2). Whether nothing that has to be told by itself is left.
    fn acknowledge(&mut self, packet: &mut Packet<'_>, idle: bool) -> bool {
        let order = if self.order == 0 { self.ended.unwrap_or(0) } else { self.order };
        let of_order = Params::default().with(Field::Order, order);
        let Acks::Cumulative { every } = self.config.acks else {
            while let Some(number) = self.unacked.first() {
                if !self.send(packet, Role::JobAck, &of_order.with(Field::Number, number)) {
                    return false;
                }
                self.unacked.remove(number);
            }
            return true;
        };
        let (executed, every) = (self.intake.executed(), u32::from(every.get()));
        while self.acked < executed {
            let next = self.acked - self.acked % every + every;
            if next > executed && !idle {
                break;
            }
            let next = next.min(executed);
            if !self.send(packet, Role::JobAck, &of_order.with(Field::Number, self.number(next))) {
                break;
            }
            self.acked = next;
        }
        true
    }

    fn status(&self) -> Params {
        self.of_order()
            .with(Field::Phase, u16::from(u8::from(self.phase)))
            .with(Field::Queued, self.number(self.intake.queued()))
            .with(Field::Executed, self.number(self.intake.executed()))
            .with(Field::Ended, self.ended)
    }

    fn of_order(&self) -> Params {
        Params::default().with(Field::Order, self.order)
    }

    pub(super) fn number(&self, count: u32) -> Option<u16> {
        self.intake.numbering().number(count)
    }

    /// Whether the message is in the packet. One that no packet could hold is refused when the session is made.
    fn send(&self, packet: &mut Packet<'_>, role: Role, params: &Params) -> bool {
        let room = self.config.dialect.write(role, params, |message| packet.push(message));
        matches!(room, Ok(Room::Added))
    }
}
