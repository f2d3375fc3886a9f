//! The reports of the robot, and their effect on the order.

use core::time::Duration;

use super::config::{PcConfig, Rule, Takeover};
use super::state::{
    Action, Count, Link, Machine, Order, Outcome, Rejection, Reply, RobotOrder, Stage, Start,
};
use crate::content::{FromRobot, Status};
use crate::numbering::Numbering;
use crate::phase::Phase;
use crate::timing::LATEST_DATAGRAM;

impl Machine {
    pub(super) fn on_report(&mut self, now: Duration, report: FromRobot, config: &PcConfig) -> Action {
        match report {
            FromRobot::Filler => Action::Nothing,
            FromRobot::WrongSide => Action::Rejected(Rejection::NotExpected),
            FromRobot::Unusable => {
                self.doubt(config);
                Action::Nothing
            }
            FromRobot::JobAck { order, number } => self.on_job_ack(order, number, config),
            FromRobot::Pause { order, queued } => {
                if !self.is_running(order) {
                    return Action::Rejected(Rejection::WrongOrder);
                }
                self.count.queue(config.numbering(), queued);
                Action::Paused
            }
            FromRobot::Request { order, number } => self.on_request(order, number, config),
            FromRobot::OrderAck { active } => self.on_order_ack(active, config),
            FromRobot::EndAck { ended, active, executed } => self.on_end_ack(ended, active, executed, config),
            FromRobot::Status(status) => self.on_status(now, status, config),
        }
    }

    /// Returns whether the order runs: it does if the robot names it.
    fn is_running(&mut self, order: u16) -> bool {
        match &mut self.order {
            Order::Running { number, left_at, .. } if *number == order => {
                *left_at = Duration::MAX;
                true
            }
            Order::Running { .. } | Order::Starting { .. } | Order::Idle => false,
        }
    }

    fn on_job_ack(&mut self, order: u16, number: u16, config: &PcConfig) -> Action {
        let numbering = config.numbering();
        if !self.is_running(order) {
            return Action::Rejected(Rejection::WrongOrder);
        }
        let Some(count) = self.count.of(numbering, number) else {
            return Action::Rejected(Rejection::OutOfOrder);
        };
        if config.cumulative_acks {
            self.count.execute(count);
        } else if count > self.count.executed && self.count.ahead.insert(count - self.count.executed - 1) {
            self.count.execute(self.count.executed);
            if self.count.executed < count {
                return Action::ExecutedAhead { index: count - 1 };
            }
        }
        Action::Nothing
    }

    fn on_request(&mut self, order: u16, number: u16, config: &PcConfig) -> Action {
        let numbering = config.numbering();
        let max = u32::from(numbering.max());
        if !self.is_running(order) {
            let starting = matches!(self.order, Order::Starting { .. });
            return if starting { Action::Nothing } else { Action::Rejected(Rejection::WrongOrder) };
        }
        if !matches!(self.order, Order::Running { stage: Stage::Active, .. }) {
            // A request that was in flight when the order changed.
            return Action::Nothing;
        }
        let from = self.count.executed + (numbering.ahead(self.count.executed, number) + max - 1) % max;
        if !numbering.contains(number) || from > self.count.sent {
            if self.count.sent == 0 {
                // The robot has jobs of another order with the same number.
                self.order =
                    Order::Starting { number: order, start: Start::Unsent, refusals: 0, cancelled: false };
                return self.refused(order, config);
            }
            return Action::Rejected(Rejection::OutOfOrder);
        }
        self.count.set_queued(from);
        if let Link::Connected {
            reply: Reply::Receiving { contents } | Reply::Due { contents, .. }, ..
        } = &mut self.link
        {
            contents.jobs_from = Some(from);
        }
        Action::Nothing
    }

    /// Handles the acknowledgement of a start. Our own number is acceptance only of a start that was sent on this connection.
    fn on_order_ack(&mut self, active: u16, config: &PcConfig) -> Action {
        let Order::Starting { number, start, .. } = self.order else { return Action::Nothing };
        let sent = match start {
            Start::Sent { .. } => true,
            Start::Foreign { .. } => false,
            Start::Unsent | Start::Lost => !config.keeps(Rule::LearnIdentity),
        };
        if !sent {
            return Action::Nothing;
        }
        if active == number { self.accepted(number) } else { self.refused(active, config) }
    }

    fn accepted(&mut self, number: u16) -> Action {
        let cancelled = matches!(self.order, Order::Starting { cancelled: true, .. });
        let stage = if cancelled { Stage::Interrupted } else { Stage::Active };
        self.order = Order::Running { number, stage, left_at: Duration::MAX };
        Action::Started
    }

    /// Handles a refusal: the robot is in another order, or cannot accept any (0).
    fn refused(&mut self, active: u16, config: &PcConfig) -> Action {
        let Order::Starting { number, start, refusals, cancelled } = &mut self.order else {
            return Action::Nothing;
        };
        if *cancelled {
            return self.not_begun();
        }
        let order = *number;
        let is_over = if active == 0 {
            *refusals = refusals.saturating_add(1);
            *start = Start::Unsent;
            *refusals > config.start_retries
        } else {
            *start = Start::Foreign { order: active };
            config.takeover == Takeover::Never
        };
        if is_over {
            self.order = Order::Idle;
            return Action::Outcome { order, outcome: Outcome::GivenUp { active } };
        }
        Action::Refused { active }
    }

    fn on_end_ack(&mut self, ended: u16, active: u16, executed: Option<u16>, config: &PcConfig) -> Action {
        self.learn(active);
        match &mut self.order {
            Order::Starting { start, .. } => {
                if matches!(start, Start::Foreign { order } if *order != active) {
                    *start = Start::Unsent;
                }
                Action::Nothing
            }
            Order::Running { number, .. } if *number == ended && active != ended => {
                match self.executed_at_end(executed, config) {
                    Some(()) => self.over(config),
                    None => Action::Rejected(Rejection::OutOfOrder),
                }
            }
            Order::Running { .. } | Order::Idle => Action::Nothing,
        }
    }

    fn learn(&mut self, order: u16) {
        if let Link::Connected { robot, .. } = &mut self.link {
            *robot = RobotOrder::In { order };
        }
    }

    /// Records the jobs that were executed at the end of the order; `None` if the number is impossible.
    fn executed_at_end(&mut self, executed: Option<u16>, config: &PcConfig) -> Option<()> {
        let numbering = config.numbering();
        if let Some(number) = executed {
            let count = self.count.of(numbering, number)?;
            self.count.execute(count);
        }
        Some(())
    }

    /// Handles the robot's report that our order is over, with its last executed job.
    fn over(&mut self, config: &PcConfig) -> Action {
        let order = core::mem::replace(&mut self.order, Order::Idle).number();
        let Count { executed, sent, total, is_unsure, .. } = self.count;
        // Only its own acknowledgement reports that a job was executed ahead of others, and that may be lost.
        let late = config.datagrams && !config.cumulative_acks && config.keeps(Rule::DoubtCorrupt);
        if (is_unsure || late) && executed < sent {
            return Action::Outcome { order, outcome: Outcome::Unknown { executed, sent } };
        }
        Action::Outcome { order, outcome: Outcome::Over { executed, complete: total == Some(executed) } }
    }

    fn on_status(&mut self, now: Duration, status: Status, config: &PcConfig) -> Action {
        let Status { order: active, queued, executed, ended, .. } = status;
        let has_jobs = queued.is_some() || executed.is_some() || !is_active(status);
        self.learn(active);
        if let Link::Connected {
            reply: Reply::Receiving { contents } | Reply::Due { contents, .. }, ..
        } = &mut self.link
        {
            contents.status = true;
        }
        match &mut self.order {
            Order::Idle => Action::Nothing,
            Order::Starting { number, start, cancelled, .. } => {
                let number = *number;
                match *start {
                    Start::Foreign { order } if order != active => *start = Start::Unsent,
                    Start::Foreign { .. } if config.takeover == Takeover::Never => {
                        return self.refused(active, config);
                    }
                    Start::Foreign { .. } => {}
                    // The answer was lost with its connection; or it is an old order.
                    _ if active == number && has_jobs => return self.refused(active, config),
                    Start::Unsent if active == number && config.keeps(Rule::LearnIdentity) => {
                        return self.refused(active, config);
                    }
                    _ if active == number => return self.accepted(number),
                    Start::Lost if *cancelled => return self.not_begun(),
                    Start::Lost => *start = Start::Unsent,
                    Start::Unsent | Start::Sent { .. } => {}
                }
                Action::Nothing
            }
            Order::Running { number, .. } if *number == active => {
                self.is_running(active);
                if self.executed_at_end(executed, config).is_none() {
                    return Action::Rejected(Rejection::OutOfOrder);
                }
                self.count.queue(config.numbering(), queued);
                Action::Nothing
            }
            Order::Running { number, left_at, .. } => {
                let number = *number;
                if config.datagrams && config.keeps(Rule::LateReports) {
                    // The report may be an old one that was overtaken.
                    *left_at = (*left_at).min(now.saturating_add(LATEST_DATAGRAM));
                    if now < *left_at {
                        return Action::Nothing;
                    }
                }
                if ended == number && active == 0 && self.executed_at_end(executed, config).is_some() {
                    return self.over(config);
                }
                let Count { executed, sent, .. } = self.count;
                if executed == sent {
                    return self.over(config);
                }
                self.order = Order::Idle;
                Action::Outcome { order: number, outcome: Outcome::Unknown { executed, sent } }
            }
        }
    }
}

fn is_active(status: Status) -> bool {
    matches!(status.phase, Phase::Active)
}

impl Count {
    /// Returns the count for a number of the robot: from the last job known to be executed up to the last sent.
    fn of(&self, numbering: Numbering, number: u16) -> Option<u32> {
        let count = self.executed + numbering.ahead(self.executed, number);
        (numbering.contains(number) && count <= self.sent).then_some(count)
    }

    /// Records that all jobs up to a count are executed, and those that were executed ahead and follow it.
    fn execute(&mut self, count: u32) {
        while self.executed < count || self.executed < self.sent && self.ahead.contains(0) {
            self.ahead.pass();
            self.executed += 1;
            self.is_news = true;
        }
        self.set_queued(self.queued.max(self.executed));
    }

    fn queue(&mut self, numbering: Numbering, last: Option<u16>) {
        if let Some(count) = last.map_or(Some(self.executed), |number| self.of(numbering, number)) {
            self.set_queued(count);
        }
    }

    fn set_queued(&mut self, count: u32) {
        self.is_news |= self.queued != count;
        self.queued = count;
    }
}
