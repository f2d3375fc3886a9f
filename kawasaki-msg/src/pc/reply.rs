//! The answer to everything that has come.

use core::time::Duration;

use super::{Core, JobSource, Owed, Supply, Takeover};
use crate::dialect::{Field, Params, Role};
use crate::job::Job;
use crate::packet::{Packet, Room};
use crate::state::{OrderEvent, Phase};

impl<S: JobSource> Core<S> {
    pub(super) fn answer(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        let mut packet = Packet::new(out, self.config.limits, self.config.dialect.charset());
        self.finish_when_done();
        // Cleared before the answer is made: what comes later is a new reason to answer.
        let owed = core::mem::take(&mut self.owed);
        if owed.status {
            let params = Params::default()
                .with(Field::Order, if self.phase == Phase::Idle { 0 } else { self.order.number })
                .with(Field::Phase, u16::from(u8::from(self.phase)))
                .with(Field::Queued, self.numbering.number(self.order.sent))
                .with(Field::Executed, self.numbering.number(self.order.executed));
            self.send(&mut packet, Role::Status, &params);
        }
        self.command_robot(now, &mut packet);
        for i in 0..self.commands.len() {
            let Some(Some((id, value))) = self.commands.get(i).copied() else { continue };
            let mut params = Params::default().with(Field::Order, self.order.number);
            params.set(Field::Value, value);
            if self.send(&mut packet, Role::Command(id), &params)
                && let Some(place) = self.commands.get_mut(i)
            {
                *place = None;
            }
        }
        if let Some(from) = owed.jobs {
            self.send_jobs(&mut packet, from);
        }
        if packet.is_empty() {
            self.send(&mut packet, Role::Filler, &Params::default());
        }
        let length = packet.as_bytes().len();
        if length == 0 {
            self.owed = Owed { heard: true, ..owed };
            return None;
        }
        Some(length)
    }

    fn finish_when_done(&mut self) {
        let order = &mut self.order;
        if self.phase == Phase::Active && self.config.end_when_done && order.executed == order.sent {
            let next = order.source.as_mut().map(|source| source.line(order.sent));
            if next == Some(Supply::End) {
                order.total = Some(order.sent);
                self.go(OrderEvent::End);
            }
        }
    }

    /// What the phase asks of the robot, in every answer until it has acknowledged it: told twice, it does no harm.
    ///
    /// But for a start: one that is still under way when the robot has accepted the first and been reset begins the order again.
    /// A stream loses none, and robots that forget what they have read are told again as late as silent ones are given up.
    fn command_robot(&mut self, now: Duration, packet: &mut Packet<'_>) {
        let order = Params::default().with(Field::Order, self.order.number);
        match (self.phase, self.foreign) {
            (Phase::Starting, None) => {
                let patience = self.config.silence;
                let told = self.start_sent.is_some_and(|at| patience.is_zero() || now < at + patience);
                if (self.config.datagrams || !told)
                    && self.send(packet, Role::OrderStart, &order.with(Field::Number, 1))
                {
                    self.start_sent = Some(now);
                }
            }
            (Phase::Starting, Some(foreign)) => {
                let end = self.config.takeover == Takeover::End;
                let role = if end { Role::OrderEnd } else { Role::OrderInterrupt };
                self.send(packet, role, &Params::default().with(Field::Order, foreign));
            }
            (Phase::Ending, _) => {
                self.send(packet, Role::OrderEnd, &order);
            }
            (Phase::Interrupted, _) => {
                self.send(packet, Role::OrderInterrupt, &order);
            }
            (Phase::Idle | Phase::Active | Phase::Alarm | Phase::Other(_), _) => {}
        }
    }

    /// As many jobs as fit, and no more than the numbers can tell apart.
    fn send_jobs(&mut self, packet: &mut Packet<'_>, from: u32) {
        let max = u32::from(self.numbering.max());
        // A late datagram may bring an old number back: half the numbers are kept apart for it.
        let window = if self.config.datagrams { max / 2 } else { max - 1 };
        let mut index = from;
        while self.phase == Phase::Active && index - self.order.executed < window {
            let Some(source) = &mut self.order.source else { break };
            let line = match source.line(index) {
                Supply::Line(line) => line,
                Supply::Later => break,
                Supply::End => {
                    self.order.total = Some(index);
                    break;
                }
            };
            let job = Job { number: self.numbering.next(index), line };
            if !self.send(packet, Role::Job, &Params::from_job(self.order.number, job)) {
                break;
            }
            index += 1;
            self.order.sent = self.order.sent.max(index);
        }
    }
}

impl<S> Core<S> {
    /// Whether the message is in the packet. One that no packet could hold is refused when the session is made.
    fn send(&self, packet: &mut Packet<'_>, role: Role, params: &Params) -> bool {
        let room = self.config.dialect.write(role, params, |message| packet.push(message));
        matches!(room, Ok(Room::Added))
    }
}
