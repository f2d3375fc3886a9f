//! What a robot sends.

use core::cell::Cell;
use core::num::NonZeroU16;
use core::time::Duration;

use super::config::{Acks, Config, Rule};
use super::state::{AckState, Action, Cycle, Ended, Flow, Link, Machine, Order, Recovery, Sent, Stage};
use crate::content::{FromRobot, Status};

impl<const WORDS: usize> Machine<WORDS> {
    /// The messages of the packet that is due: `send` takes each, or has no room for it. What has none waits for the next cycle; a
    /// packet holds at least one message.
    pub fn packet(&self, now: Duration, config: &Config, mut send: impl FnMut(FromRobot) -> bool) -> Sent {
        let mut sent = Sent::default();
        let Link::Connected { synced, status_at, .. } = self.link else { return sent };
        let is_empty = Cell::new(true);
        let mut send = |message| {
            let is_sent = send(message);
            is_empty.set(is_empty.get() && !is_sent);
            is_sent
        };
        let numbering = config.numbering();
        let status = self.replies.status || now >= status_at;
        let asks = synced
            && matches!(self.order, Order::Active { stage: Stage::Intake { flow: Flow::Asking, .. }, .. });
        let is_idle = !asks && !status && !self.replies.pause && self.replies.start.is_none();
        let all_acked = self.acknowledge(is_idle, config, &mut sent, &mut send);
        let active = self.order.number();
        if let Some(answer) = self.replies.start {
            sent.start = send(FromRobot::OrderAck { active: answer });
        }
        if let Some(Ended { order, executed }) = self.ended
            && self.replies.end
            && all_acked
        {
            // Another order may have begun since.
            sent.end = send(FromRobot::EndAck { ended: order, active, executed });
        }
        sent.status = status && all_acked && send(FromRobot::Status(self.status(config)));
        let queued = numbering.number(self.queued);
        sent.pause = self.replies.pause && send(FromRobot::Pause { order: active, queued });
        if asks {
            sent.request = send(FromRobot::Request { order: active, number: numbering.next(self.queued) });
        }
        if is_empty.get() {
            send(FromRobot::Filler);
        }
        sent
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
                && config.rules.keeps(Rule::StepsByClock)
            {
                *recovery = Recovery::Waiting { failures, until: now.saturating_add(config.patience) };
            }
        }
        Some(Action::Sent)
    }

    /// Acknowledges what is executed: every k-th job, or what is left "at least when there is nothing else to send" (thesis,
    /// section 11.2) or to execute. Whether no individual acknowledgement is left.
    fn acknowledge(
        &self,
        is_idle: bool,
        config: &Config,
        sent: &mut Sent,
        send: &mut impl FnMut(FromRobot) -> bool,
    ) -> bool {
        let order = match (self.order, self.ended) {
            (Order::Active { number, .. }, _) => number,
            (Order::Idle, Some(ended)) => ended.order,
            (Order::Idle, None) => return true,
        };
        match &self.acks {
            AckState::Individual { unacked, .. } => {
                for number in unacked.iter() {
                    if !send(FromRobot::JobAck { order, number }) {
                        return false;
                    }
                    sent.acked += 1;
                }
            }
            AckState::Cumulative { acked } => {
                let every =
                    if let Acks::Cumulative { every } = config.acks { every } else { NonZeroU16::MIN };
                let every = u32::from(every.get());
                let rest = is_idle || self.executed == self.queued;
                let mut done = *acked;
                while done < self.executed {
                    let next = done - done % every + every;
                    if next > self.executed && !rest {
                        break;
                    }
                    let next = next.min(self.executed);
                    let Some(number) = config.numbering().number(next) else { break };
                    if !send(FromRobot::JobAck { order, number }) {
                        break;
                    }
                    done = next;
                }
                sent.acked = done - *acked;
            }
        }
        true
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
