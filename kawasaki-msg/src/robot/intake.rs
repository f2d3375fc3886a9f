//! The handling of orders and jobs by a robot.

use core::time::Duration;

use super::config::{Acks, RobotConfig, Rule};
use super::state::{Action, Flow, Gap, Link, Machine, Order, Recovery, Rejection, Stage, Starts};
use crate::numbering::AheadJobs;

impl Machine {
    /// Handles a job: "If the job is not the next one, or its values are out of bounds, it and what follows it in the packet
    /// is destroyed" (thesis, sections 7.2 and 12).
    pub(super) fn on_job(
        &mut self,
        (order, number): (u16, u16),
        good: bool,
        room: bool,
        config: &RobotConfig,
    ) -> Action {
        let numbering = config.numbering();
        let Order::Active { number: active, stage: Stage::Intake { flow, gap, recovery } } = &mut self.order
        else {
            let other = self.order.number() != order;
            return Action::Rejected(if other { Rejection::WrongOrder } else { Rejection::NotExpected });
        };
        if *gap == Gap::Rest && config.keeps(Rule::DestroyRest) {
            return Action::Discarded;
        }
        let next = numbering.next(self.queued);
        if order != *active {
            return self.failed(Rejection::WrongOrder, config);
        }
        if !good {
            return self.failed(Rejection::Bad, config);
        }
        if number == next {
            // The job was executed ahead of the others before the list was cleared.
            let is_executed = self.ahead.contains(self.queued - self.executed);
            let can_ack = config.acks != Acks::Individual || self.queued - self.acked < AheadJobs::MAX;
            if !(is_executed || room && can_ack) {
                if *flow != Flow::Full {
                    *flow = Flow::Full;
                    self.replies.pause = true;
                }
                *gap = Gap::Rest;
                return Action::Rejected(Rejection::QueueFull);
            }
            self.queued += 1;
            *gap = Gap::Closed;
            *recovery = Recovery::Resting { failures: recovery.failures() };
            return if is_executed { Action::QueuedBefore } else { Action::Queue };
        }
        let ahead = numbering.ahead(self.queued, number);
        if !numbering.contains(number) {
            return self.failed(Rejection::OutOfRange, config);
        }
        if (2..=u32::from(numbering.max()) / 2).contains(&ahead) {
            return self.failed(Rejection::OutOfOrder, config);
        }
        // The job was sent twice: harmless, and the next one may be new.
        Action::Rejected(Rejection::Repeated)
    }

    /// Handles an unusable message in place of a job: jobs are missing from here on.
    pub(super) fn failed(&mut self, why: Rejection, config: &RobotConfig) -> Action {
        if let Order::Active { stage: Stage::Intake { gap, .. }, .. } = &mut self.order {
            let before = core::mem::replace(gap, Gap::Rest);
            if before == Gap::Rest && config.keeps(Rule::DestroyRest) {
                return Action::Discarded;
            }
        }
        Action::Rejected(why)
    }

    /// Handles the start of an order: "If the order went through, its number is returned, otherwise 0 or the number of the
    /// active order" (thesis, section 10.1).
    ///
    /// A late datagram may name an order that is over: a start with a number that has just ended is refused. A robot that has
    /// just been started knows no such numbers, and ignores all starts for as long as such a datagram may still come.
    pub(super) fn on_start(
        &mut self,
        now: Duration,
        (order, first): (u16, u16),
        room: bool,
        config: &RobotConfig,
    ) -> Action {
        if self.ignores_starts(now, config) {
            return Action::Nothing;
        }
        let is_old = match self.starts {
            Starts::Any => false,
            Starts::New { ended, .. } => ended.contains(&order) && config.keeps(Rule::NewStarts),
        };
        self.replies.status = true;
        let Order::Active { number, .. } = self.order else {
            if order == 0 || first != 1 || is_old || !room {
                self.replies.start = Some(0);
                let refused = order == 0 || first == 1;
                return if refused { Action::Refused } else { Action::Rejected(Rejection::NotFromFirst) };
            }
            let recovery = Recovery::Resting { failures: 0 };
            let stage = Stage::Intake { flow: Flow::Asking, gap: Gap::Closed, recovery };
            self.order = Order::Active { number: order, stage };
            (self.queued, self.executed) = (0, 0);
            (self.ahead, self.acked, self.acked_ahead) = (AheadJobs::default(), 0, AheadJobs::default());
            self.replies.start = Some(order);
            return Action::Started;
        };
        // The active order, of which nothing has come: the answer was lost. Nothing begins again, not even the recovery.
        let again = number == order && self.queued == 0 && first == 1;
        let refused = config.refuse_repeated_start && number == order && !again;
        self.replies.start = Some(if refused { 0 } else { number });
        if again { Action::Nothing } else { Action::Refused }
    }

    /// Returns whether a start may still be a late datagram. If the session was not called for a while, a start that came in
    /// time is read after that time: so the first start that is read then extends the time by one exchange.
    pub(super) fn ignores_starts(&mut self, now: Duration, config: &RobotConfig) -> bool {
        let Starts::New { ignored_until, drained, .. } = &mut self.starts else { return false };
        if now >= *ignored_until && !*drained {
            *drained = true;
            if config.keeps(Rule::DrainStarts) {
                *ignored_until = now.saturating_add(config.exchange);
            }
        }
        now < *ignored_until && config.keeps(Rule::IgnoreStarts)
    }

    pub(super) fn on_end(&mut self, order: u16, config: &RobotConfig) -> Action {
        let Order::Active { number, stage } = &mut self.order else {
            self.repeat_end(order);
            return Action::Nothing;
        };
        if *number != order {
            self.repeat_end(order);
            return Action::Nothing;
        }
        let missing = Action::Rejected(Rejection::JobsMissing);
        match stage {
            Stage::Intake { gap: Gap::Rest, .. } if config.keeps(Rule::DestroyRest) => {
                return Action::Discarded;
            }
            Stage::Intake { gap: gap @ (Gap::Asked | Gap::EndOnce), .. }
                if config.keeps(Rule::EndFillsGap) =>
            {
                // An answer to a packet that was overdue may have been sent before the request for the missing jobs was read.
                match &mut self.link {
                    Link::Connected { unanswered: unanswered @ 1.., .. }
                        if config.keeps(Rule::CountUnanswered) =>
                    {
                        *unanswered -= 1;
                    }
                    Link::Disconnected { .. } | Link::Connecting { .. } | Link::Connected { .. } => {
                        *gap = Gap::EndOnce;
                    }
                }
                return missing;
            }
            Stage::Clearing { .. } if config.keeps(Rule::GapAtConnection) => return missing,
            Stage::Intake { .. } | Stage::Clearing { .. } | Stage::Alarm => {}
            Stage::Ending | Stage::Interrupted { .. } => return Action::Nothing,
        }
        *stage = Stage::Ending;
        self.replies.status = true;
        Action::Ending
    }

    pub(super) fn on_interrupt(&mut self, order: u16) -> Action {
        if order == 0 || order != self.order.number() {
            self.repeat_end(order);
            return Action::Nothing;
        }
        self.interrupt().unwrap_or(Action::Nothing)
    }

    pub(super) fn on_status(&mut self, order: u16, config: &RobotConfig) -> Action {
        if config.end_foreign_order && order != self.order.number() {
            return self.interrupt().unwrap_or(Action::Nothing);
        }
        Action::Nothing
    }

    /// Acknowledges the end of an order that is not active again if it was the last one. The progress of another order is not
    /// known here: the status reports the known orders.
    fn repeat_end(&mut self, order: u16) {
        if self.ended.is_some_and(|ended| ended.order == order) {
            self.replies.end = true;
        } else {
            self.replies.status = true;
        }
    }
}
