//! What a robot sends.

use core::cell::Cell;
use core::num::NonZeroU16;
use core::time::Duration;

use super::config::{Acks, RobotConfig, RobotRule};
use super::state::{AckState, Cycle, Ended, Flow, Link, Machine, Order, Recovery, Stage};
use crate::content::{FromRobot, Status};

impl<const WORDS: usize> Machine<WORDS> {
    /// The next packet, if it is due: `send` takes each message of it, or has no room for it. What has none waits for the next
    /// cycle; a packet holds at least one message.
    pub fn transmit(
        &mut self,
        now: Duration,
        config: &RobotConfig<'_>,
        mut send: impl FnMut(FromRobot) -> bool,
    ) -> bool {
        let Link::Connected { cycle: Cycle::Ready { at }, synced, status_at, .. } = self.link else {
            return false;
        };
        if now < at {
            return false;
        }
        let is_empty = Cell::new(true);
        let mut send = |message| {
            let sent = send(message);
            is_empty.set(is_empty.get() && !sent);
            sent
        };
        let numbering = config.numbering();
        let status = self.replies.status || now >= status_at;
        let asks = synced
            && matches!(self.order, Order::Active { stage: Stage::Intake { flow: Flow::Asking, .. }, .. });
        let is_idle = !asks && !status && !self.replies.pause && self.replies.start.is_none();
        let all_acked = self.acknowledge(is_idle, config, &mut send);
        let active = self.order.number();
        if let Some(answer) = self.replies.start
            && send(FromRobot::OrderAck { active: answer })
        {
            self.replies.start = None;
        }
        if let Some(Ended { order, executed }) = self.ended
            && self.replies.end
            && all_acked
            // Another order may have begun since.
            && send(FromRobot::EndAck { ended: order, active, executed })
        {
            self.replies.end = false;
        }
        if status && all_acked && send(FromRobot::Status(self.status(config))) {
            self.replies.status = false;
            if let Link::Connected { status_at, .. } = &mut self.link {
                *status_at = now.saturating_add(config.status_period);
            }
        }
        let queued = numbering.number(self.queued);
        if self.replies.pause && send(FromRobot::Pause { order: active, queued }) {
            self.replies.pause = false;
        }
        if let Order::Active { number: order, stage: Stage::Intake { flow: Flow::Asking, gap, recovery } } =
            &mut self.order
        {
            if synced && send(FromRobot::Request { order: *order, number: numbering.next(self.queued) }) {
                *gap = gap.asked();
            }
            if let Recovery::Resting { failures } = *recovery
                && self.executed == self.queued
                && config.keeps(RobotRule::StepsByClock)
            {
                *recovery = Recovery::Waiting { failures, until: now.saturating_add(config.patience) };
            }
        }
        if is_empty.get() && !send(FromRobot::Filler) {
            return false;
        }
        if let Link::Connected { cycle, .. } = &mut self.link {
            let not_before = now.saturating_add(config.exchange);
            let overdue_at = now.saturating_add(config.reply_timeout);
            *cycle = Cycle::Waiting { not_before, overdue_at, answered: false };
        }
        true
    }

    /// Acknowledges what is executed: every k-th job, or what is left "at least when there is nothing else to send" (thesis,
    /// section 11.2) or to execute. Whether nothing that has to be acknowledged by itself is left.
    fn acknowledge(
        &mut self,
        is_idle: bool,
        config: &RobotConfig<'_>,
        send: &mut impl FnMut(FromRobot) -> bool,
    ) -> bool {
        let order = match (self.order, self.ended) {
            (Order::Active { number, .. }, _) => number,
            (Order::Idle, Some(ended)) => ended.order,
            (Order::Idle, None) => return true,
        };
        match &mut self.acks {
            AckState::Individual { unacked, .. } => {
                while let Some(number) = unacked.first() {
                    if !send(FromRobot::JobAck { order, number }) {
                        return false;
                    }
                    unacked.remove(number);
                }
            }
            AckState::Cumulative { acked } => {
                let every =
                    if let Acks::Cumulative { every } = config.acks { every } else { NonZeroU16::MIN };
                let every = u32::from(every.get());
                let rest = is_idle || self.executed == self.queued;
                while *acked < self.executed {
                    let next = *acked - *acked % every + every;
                    if next > self.executed && !rest {
                        break;
                    }
                    let next = next.min(self.executed);
                    let Some(number) = config.numbering().number(next) else { break };
                    if !send(FromRobot::JobAck { order, number }) {
                        break;
                    }
                    *acked = next;
                }
            }
        }
        true
    }

    fn status(&self, config: &RobotConfig<'_>) -> Status {
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
