//! The packets of a robot.

use core::time::Duration;

use super::config::{Acks, Config, Rule};
use super::state::{AckState, Action, Cycle, Due, Flow, Link, Machine, Order, Recovery, Sent, Stage};
use crate::content::{FromRobot, Status};

impl<const WORDS: usize> Machine<WORDS> {
    /// The messages of the packet that is due.
    pub(super) fn due(&self, now: Duration, config: &Config) -> Due {
        let numbering = config.numbering();
        let Link::Connected { synced, status_at, .. } = self.link else { return Due::default() };
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
        Due {
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

    /// The acknowledgements in a packet, each with the number of jobs that it is the first to cover: every k-th job, or all "at least
    /// when there is nothing else to send" (thesis, section 11.2) or to execute.
    pub fn acks(&self, due: &Due, config: &Config) -> impl Iterator<Item = (u32, FromRobot)> {
        let order = if let Order::Active { number, .. } = self.order {
            Some(number)
        } else {
            self.ended.map(|ended| ended.order)
        };
        let ack = move |number| order.map(|order| FromRobot::JobAck { order, number });
        let every = if let Acks::Cumulative { every } = config.acks { u32::from(every.get()) } else { 1 };
        let until = if due.all_acks { self.executed } else { self.executed - self.executed % every };
        let (mut done, unacked) = match &self.acks {
            AckState::Cumulative { acked } => (*acked, None),
            AckState::Individual { unacked, .. } => (until, Some(unacked)),
        };
        let numbering = config.numbering();
        let cumulative = core::iter::from_fn(move || {
            let next = (done - done % every + every).min(until);
            let count = next.checked_sub(done).filter(|count| *count > 0)?;
            done = next;
            Some((count, ack(numbering.number(next)?)?))
        });
        let individual = unacked.into_iter().flat_map(|unacked| unacked.iter());
        individual.filter_map(move |number| Some((1, ack(number)?))).chain(cumulative)
    }

    pub(super) fn on_sent(&mut self, now: Duration, sent: Sent, config: &Config) -> Option<Action> {
        let Link::Connected { cycle: cycle @ Cycle::Ready { .. }, status_at, .. } = &mut self.link else {
            return None;
        };
        let not_before = now.saturating_add(config.exchange);
        let overdue_at = now.saturating_add(config.reply_timeout);
        *cycle = Cycle::Waiting { not_before, overdue_at, answered: false };
        match &mut self.acks {
            AckState::Cumulative { acked } => *acked += sent.acked,
            AckState::Individual { unacked, .. } => {
                for _ in 0..sent.acked {
                    if let Some(number) = unacked.first() {
                        unacked.remove(number);
                    }
                }
            }
        }
        if sent.start {
            self.replies.start = None;
        }
        self.replies.end &= !sent.end;
        if sent.status {
            self.replies.status = false;
            *status_at = now.saturating_add(config.status_period);
        }
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

    fn status(&self, config: &Config) -> Status {
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
