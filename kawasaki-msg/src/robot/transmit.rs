//! The packets of a robot.

use core::time::Duration;

use super::config::{Acks, RobotConfig, Rule};
use super::state::{Action, Cycle, DuePacket, Flow, Link, Machine, Order, Recovery, SentPacket, Stage};
use crate::content::{FromRobot, Status};
use crate::numbering::AheadJobs;

impl Machine {
    /// Returns the messages of the packet that is due.
    pub(super) fn due(&self, now: Duration, config: &RobotConfig) -> DuePacket {
        let numbering = config.numbering();
        let Link::Connected { synced, status_at, .. } = self.link else { return DuePacket::default() };
        let asks = synced
            && matches!(self.order, Order::Active { stage: Stage::Intake { flow: Flow::Asking, .. }, .. });
        let has_status = self.replies.status || now >= status_at;
        let is_idle = !asks && !has_status && !self.replies.pause && self.replies.start.is_none();
        let active = self.order.number();
        // Another order may have begun since.
        let end = self.ended.filter(|_| self.replies.end).map(|ended| FromRobot::EndAck {
            ended: ended.order,
            active,
            executed: ended.executed,
        });
        DuePacket {
            all_acks: is_idle || self.executed == self.queued,
            start: self.replies.start.map(|active| FromRobot::OrderAck { active }),
            end,
            status: has_status.then(|| FromRobot::Status(self.status(config))),
            pause: self
                .replies
                .pause
                .then(|| FromRobot::Pause { order: active, queued: numbering.number(self.queued) }),
            request: asks.then(|| FromRobot::Request { order: active, number: numbering.next(self.queued) }),
        }
    }

    /// Returns the acknowledgements in a packet, each with the number of jobs that it is the first to cover: every k-th job,
    /// or all "at least when there is nothing else to send" (thesis, section 11.2) or to execute.
    pub fn acks(&self, due: &DuePacket, config: &RobotConfig) -> impl Iterator<Item = (u32, FromRobot)> {
        let order = if let Order::Active { number, .. } = self.order {
            Some(number)
        } else {
            self.ended.map(|ended| ended.order)
        };
        let ack = move |number| order.map(|order| FromRobot::JobAck { order, number });
        let numbering = config.numbering();
        let (mut done, every, individual) = match config.acks {
            Acks::Cumulative { every } => (self.acked, u32::from(every.get()), None),
            Acks::Individual => (self.executed, 1, Some(self.unacked(config))),
        };
        let until = if due.all_acks { self.executed } else { self.executed - self.executed % every };
        let cumulative = core::iter::from_fn(move || {
            let next = (done - done % every + every).min(until);
            let count = next.checked_sub(done).filter(|count| *count > 0)?;
            done = next;
            Some((count, next))
        });
        let individual = individual.into_iter().flatten().map(|count| (1, count));
        let all = individual.chain(cumulative);
        all.filter_map(move |(count, last)| Some((count, ack(numbering.number(last)?)?)))
    }

    /// Returns the counts of the executed jobs that are not acknowledged, the lowest number first.
    fn unacked(&self, config: &RobotConfig) -> impl Iterator<Item = u32> {
        let max = u32::from(config.max_number);
        let last = if self.ahead.is_empty() { self.executed } else { self.executed + AheadJobs::MAX };
        let last = last.min(self.acked + max);
        // The numbers begin again after this count.
        let wrap = (self.acked - self.acked % max + max).min(last);
        let is_executed =
            |count: u32| count <= self.executed || self.ahead.contains(count - self.executed - 1);
        (wrap + 1..=last)
            .chain(self.acked + 1..=wrap)
            .filter(move |count| is_executed(*count) && !self.acked_ahead.contains(count - self.acked - 1))
    }

    pub(super) fn on_sent(
        &mut self,
        now: Duration,
        sent: SentPacket,
        config: &RobotConfig,
    ) -> Option<Action> {
        let Link::Connected { cycle: cycle @ Cycle::Ready { .. }, status_at, .. } = &mut self.link else {
            return None;
        };
        let not_before = now.saturating_add(config.exchange);
        let overdue_at = now.saturating_add(config.reply_timeout);
        *cycle = Cycle::Waiting { not_before, overdue_at, answered: false };
        if sent.status {
            self.replies.status = false;
            *status_at = now.saturating_add(config.status_period);
        }
        self.acknowledge(sent.acked, config);
        if sent.start {
            self.replies.start = None;
        }
        self.replies.end &= !sent.end;
        self.replies.pause &= !sent.pause;
        if let Order::Active { stage: Stage::Intake { flow: Flow::Asking, gap, recovery }, .. } =
            &mut self.order
        {
            if sent.request {
                *gap = gap.asked();
            }
            if let Recovery::Resting { failures } = *recovery
                && self.executed == self.queued
                && config.keeps(Rule::StepsByClock)
            {
                *recovery = Recovery::Waiting { failures, until: now.saturating_add(config.patience) };
            }
        }
        Some(Action::Sent)
    }

    fn acknowledge(&mut self, acked: u32, config: &RobotConfig) {
        if config.acks != Acks::Individual {
            self.acked += acked;
            return;
        }
        for _ in 0..acked {
            let Some(count) = self.unacked(config).next() else { return };
            self.acked_ahead.insert(count - self.acked - 1);
            while self.acked_ahead.contains(0) {
                self.acked_ahead.pass();
                self.acked += 1;
            }
        }
    }

    fn status(&self, config: &RobotConfig) -> Status {
        let numbering = config.numbering();
        Status {
            order: self.order.number(),
            phase: self.phase(),
            queued: numbering.number(self.queued),
            executed: numbering.number(self.executed),
            ended: self.ended.map_or(0, |ended| ended.order),
        }
    }
}
