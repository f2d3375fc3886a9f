//! The machine of a robot: its reaction to each input. This file has everything but jobs and orders.

use core::time::Duration;

use robot_session::Unexpected;
use robot_session::end::{Expiry, is_due};

use super::config::{Acks, RobotConfig, Rule};
pub use super::state::{
    Action, Cycle, DuePacket, EndedOrder, Flow, Gap, Input, Link, Machine, Order, Recovery, RecoveryStep,
    Rejection, Replies, Report, SentPacket, Stage, Starts,
};
use crate::content::FromPc;
use crate::numbering::AheadJobs;
use crate::phase::Phase;
use crate::timing;

impl robot_session::end::Machine for Machine {
    const END: &'static str = "robot";
    const EXPIRY: Expiry = Expiry::Last;
    type Input = Input;
    type Action = Action;
    /// [`Machine::acks`] has the acknowledgements.
    type Transmit = DuePacket;
    type Config = RobotConfig;

    /// # Errors
    /// There is no connection, or no order for this input.
    fn on(&mut self, now: Duration, input: Input, config: &RobotConfig) -> Result<Action, Unexpected> {
        let action = match input {
            Input::Connected => {
                self.on_connected(now, config);
                Some(Action::Connected)
            }
            Input::Disconnected => Some(self.on_disconnected(now, config)),
            Input::Timeout => Some(self.on_timeout(now, config)),
            Input::Message { message, room } => self.on_message(now, message, room, config),
            Input::Corrupt => self.on_corrupt(config),
            Input::ReadEnd { whole } => Some(self.on_read_end(now, whole)),
            Input::Executed { number } => self.on_executed(number, config),
            Input::Settled => Some(self.on_settled(now, config)),
            Input::Drained => Some(self.on_drained()),
            Input::ClearQueue => self.clear_queue(),
            Input::ResetOrder => self.interrupt(),
            Input::Sent(sent) => self.on_sent(now, sent, config),
            Input::Reported => self.on_reported(),
        };
        action.ok_or_else(|| self.unexpected(&input))
    }

    fn transmit(&self, now: Duration, config: &RobotConfig) -> Option<DuePacket> {
        let is_ready =
            matches!(self.link, Link::Connected { cycle: Cycle::Ready { at, .. }, .. } if is_due(at, now));
        is_ready.then(|| self.due(now, config))
    }

    fn deadline(&self) -> Option<Duration> {
        let packet = match self.link {
            Link::Connected { cycle: Cycle::Ready { at, .. }, .. } => at,
            Link::Disconnected { .. } | Link::Connecting { .. } | Link::Connected { .. } => Duration::MAX,
        };
        Some(packet.min(self.expires_at())).filter(|at| *at != Duration::MAX)
    }

    fn expires(&self, now: Duration) -> bool {
        is_due(self.expires_at(), now)
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        match &mut self.link {
            Link::Disconnected { connect_at } => f(connect_at),
            Link::Connecting { .. } => {}
            Link::Connected { cycle, status_at, .. } => {
                f(status_at);
                match cycle {
                    Cycle::Ready { at, overdue_at } => {
                        f(at);
                        f(overdue_at);
                    }
                    Cycle::Waiting { not_before, overdue_at, .. } => {
                        f(not_before);
                        f(overdue_at);
                    }
                }
            }
        }
        match &mut self.order {
            Order::Active { stage: Stage::Intake { flow, recovery, .. }, .. } => {
                if let Flow::Held { until } = flow {
                    f(until);
                }
                if let Recovery::Waiting { until, .. } = recovery {
                    f(until);
                }
            }
            Order::Active {
                stage: Stage::Clearing { reported_at, .. } | Stage::Interrupted { reported_at },
                ..
            } => f(reported_at),
            Order::Active { .. } | Order::Idle => {}
        }
        if let Starts::New { ignored_until, .. } = &mut self.starts {
            f(ignored_until);
        }
    }

    /// Returns the name of the order's state, or of the connection's if there is no order.
    fn name(&self) -> &'static str {
        match (&self.order, &self.link) {
            (Order::Active { stage: Stage::Intake { gap: Gap::Closed, .. }, .. }, _) => "Active",
            (Order::Active { stage: Stage::Intake { .. }, .. }, _) => "JobsMissing",
            (Order::Active { stage: Stage::Clearing { .. }, .. }, _) => "Clearing",
            (Order::Active { stage: Stage::Ending, .. }, _) => "Ending",
            (Order::Active { stage: Stage::Interrupted { .. }, .. }, _) => "Interrupted",
            (Order::Active { stage: Stage::Alarm, .. }, _) => "Alarm",
            (Order::Idle, Link::Disconnected { .. }) => "Disconnected",
            (Order::Idle, Link::Connecting { .. }) => "Connecting",
            (Order::Idle, Link::Connected { .. }) => "Idle",
        }
    }
}

impl Machine {
    /// Creates a robot that requests a connection at once.
    pub fn new(config: &RobotConfig) -> Self {
        let starts = if config.datagrams {
            Starts::New { ignored_until: Duration::MAX, drained: false, ended: [0; 16] }
        } else {
            Starts::Any
        };
        Self {
            link: Link::Disconnected { connect_at: Duration::ZERO },
            order: Order::Idle,
            queued: 0,
            executed: 0,
            ahead: AheadJobs::default(),
            acked: 0,
            acked_ahead: AheadJobs::default(),
            ended: None,
            replies: Replies::default(),
            starts,
        }
    }

    /// Returns the time at which [`Input::Timeout`] is due.
    fn expires_at(&self) -> Duration {
        let mut order = Duration::MAX;
        match self.order {
            Order::Active { stage: Stage::Intake { flow, recovery, .. }, .. } if self.is_connected() => {
                if let Flow::Held { until } = flow {
                    order = until;
                }
                if let Recovery::Waiting { until, .. } = recovery {
                    order = order.min(until);
                }
            }
            Order::Active {
                stage: Stage::Clearing { reported_at, .. } | Stage::Interrupted { reported_at },
                ..
            } => order = reported_at,
            Order::Active { .. } | Order::Idle => {}
        }
        match self.link {
            Link::Disconnected { connect_at: at }
            | Link::Connected { cycle: Cycle::Waiting { overdue_at: at, .. }, .. } => order.min(at),
            Link::Connecting { .. } | Link::Connected { .. } => order,
        }
    }

    /// Returns the change that is to be reported to the caller; `None` if it was.
    pub const fn report(&self) -> Option<Report> {
        match self.link {
            Link::Connecting { reported: false } => Some(Report::Connect),
            Link::Connected { close: true, .. } => Some(Report::Disconnect),
            Link::Disconnected { .. } | Link::Connecting { .. } | Link::Connected { .. } => None,
        }
    }

    fn on_reported(&mut self) -> Option<Action> {
        self.report()?;
        match &mut self.link {
            Link::Disconnected { .. } => {}
            Link::Connecting { reported } => *reported = true,
            Link::Connected { close, .. } => *close = false,
        }
        Some(Action::Nothing)
    }

    /// Returns the phase of the order, as the status reports it.
    pub const fn phase(&self) -> Phase {
        match self.order {
            Order::Idle => Phase::Idle,
            Order::Active { stage, .. } => match stage {
                Stage::Intake { .. } | Stage::Clearing { .. } => Phase::Active,
                Stage::Ending => Phase::Ending,
                Stage::Interrupted { .. } => Phase::Interrupted,
                Stage::Alarm => Phase::Alarm,
            },
        }
    }

    /// Returns whether there is a connection.
    pub const fn is_connected(&self) -> bool {
        matches!(self.link, Link::Connected { .. })
    }

    fn on_connected(&mut self, now: Duration, config: &RobotConfig) {
        self.link = Link::Connected {
            cycle: Cycle::Ready { at: now, overdue_at: now },
            silent: 0,
            unanswered: 0,
            synced: false,
            status_at: now.saturating_add(config.status_period),
            close: false,
        };
        if let Starts::New { ignored_until, .. } = &mut self.starts
            && *ignored_until == Duration::MAX
        {
            *ignored_until = now.saturating_add(timing::LATEST_DATAGRAM);
        }
        // The status reports it all; a start whose answer was lost is repeated.
        (self.replies.status, self.replies.start) = (true, None);
        // The status covers the jobs that are executed in order; those executed ahead may not have arrived.
        (self.acked, self.acked_ahead) = (self.executed, AheadJobs::default());
        if let Order::Active { stage: Stage::Intake { flow, gap, .. }, .. } = &mut self.order {
            // No time passes without a connection: a pause may be over since.
            flow.end_pause(now);
            if config.keeps(Rule::GapAtConnection) {
                *gap = Gap::Rest;
            }
        }
    }

    fn on_disconnected(&mut self, now: Duration, config: &RobotConfig) -> Action {
        let connected = match self.link {
            // The connection is closed already.
            Link::Disconnected { .. } => return Action::Nothing,
            Link::Connecting { .. } => false,
            Link::Connected { .. } => true,
        };
        self.link = Link::Disconnected { connect_at: now.saturating_add(config.reconnect_delay) };
        let is_step = config.keeps(Rule::ClosingIsStep) && connected && self.executed == self.queued;
        let Order::Active { stage: Stage::Intake { recovery, .. }, .. } = &mut self.order else {
            return Action::Nothing;
        };
        *recovery = Recovery::Resting { failures: recovery.failures() };
        if is_step { self.step(now, config) } else { Action::Nothing }
    }

    /// Handles one due deadline. A step of recovery comes first: the next cycle would restart its time.
    fn on_timeout(&mut self, now: Duration, config: &RobotConfig) -> Action {
        if let Link::Disconnected { connect_at } = self.link
            && is_due(connect_at, now)
        {
            self.link = Link::Connecting { reported: false };
            return Action::Nothing;
        }
        if let Link::Connected { cycle, silent, unanswered, close, .. } = &mut self.link {
            if let Order::Active { stage: Stage::Intake { flow, recovery, .. }, .. } = &mut self.order {
                flow.end_pause(now);
                if let Recovery::Waiting { failures, until } = *recovery
                    && is_due(until, now)
                {
                    *recovery = Recovery::Resting { failures };
                    return self.step(now, config);
                }
            }
            if let Cycle::Waiting { overdue_at, .. } = *cycle
                && is_due(overdue_at, now)
            {
                *cycle = Cycle::Ready { at: now, overdue_at: now };
                let limit = config.silent_cycles;
                *silent = silent.saturating_add(1).min(limit);
                *unanswered = unanswered.saturating_add(1).min(if limit == 0 { u16::MAX } else { limit });
                *close |= limit != 0 && *silent == limit;
                return Action::NoReply;
            }
        }
        match self.order {
            Order::Active {
                stage: Stage::Clearing { reported_at, .. } | Stage::Interrupted { reported_at },
                ..
            } if is_due(reported_at, now) => self.settle(config),
            Order::Active { .. } | Order::Idle => Action::Nothing,
        }
    }

    /// Takes a step of recovery (thesis, section 6.3).
    fn step(&mut self, now: Duration, config: &RobotConfig) -> Action {
        let Order::Active { stage, .. } = &mut self.order else { return Action::Nothing };
        let Stage::Intake { flow, recovery, .. } = stage else { return Action::Nothing };
        let failures = recovery.failures().saturating_add(1);
        *recovery = Recovery::Resting { failures };
        let step = config.step(failures);
        match step {
            RecoveryStep::Resend => {}
            RecoveryStep::Pause => {
                *flow = Flow::Held { until: now.saturating_add(config.pause) };
                self.replies.pause = true;
            }
            RecoveryStep::Clear => *stage = Stage::Clearing { failures, reported_at: Duration::MAX },
            RecoveryStep::Alarm => {
                *stage = Stage::Alarm;
                self.replies.status = true;
            }
        }
        Action::Step(step)
    }

    fn on_message(
        &mut self,
        now: Duration,
        message: FromPc,
        room: bool,
        config: &RobotConfig,
    ) -> Option<Action> {
        self.answered()?;
        Some(match message {
            FromPc::Status { order } => self.on_status(order, config),
            FromPc::Filler => Action::Nothing,
            FromPc::WrongSide => Action::Rejected(Rejection::NotExpected),
            FromPc::Unusable => self.failed(Rejection::Bad, config),
            FromPc::Job { order, number, good } => self.on_job((order, number), good, room, config),
            FromPc::Start { order, first } => self.on_start(now, (order, first), room, config),
            FromPc::End { order } => self.on_end(order, config),
            FromPc::Interrupt { order } => self.on_interrupt(order),
        })
    }

    fn on_corrupt(&mut self, config: &RobotConfig) -> Option<Action> {
        if !self.is_connected() {
            return None;
        }
        if config.keeps(Rule::DestroyRest) {
            self.answered()?;
            // The session reports the bytes themselves.
            self.failed(Rejection::Bad, config);
        }
        Some(Action::Nothing)
    }

    /// Records that something has come; `None` without a connection.
    fn answered(&mut self) -> Option<()> {
        let Link::Connected { cycle, .. } = &mut self.link else { return None };
        if let Cycle::Waiting { answered, .. } = cycle {
            *answered = true;
        }
        Some(())
    }

    /// Handles the end of a read. An answer is whole when a message has come, no half message remains, and nothing follows
    /// for a cycle of the processor. So an answer that a slow line delivers in pieces is one answer, and is read completely
    /// before the next packet requests more.
    fn on_read_end(&mut self, now: Duration, whole: bool) -> Action {
        let Link::Connected { cycle, silent, synced, .. } = &mut self.link else { return Action::Nothing };
        let silent_at = now.saturating_add(timing::CPU_CYCLE);
        match *cycle {
            Cycle::Waiting { not_before, overdue_at, answered: true } if whole => {
                let at = silent_at.min(overdue_at.max(now)).max(not_before);
                *cycle = Cycle::Ready { at, overdue_at };
                (*silent, *synced) = (0, true);
                return Action::Answered;
            }
            Cycle::Ready { at, overdue_at } if whole => {
                *cycle = Cycle::Ready { at: silent_at.min(overdue_at).max(at), overdue_at };
            }
            Cycle::Ready { at, overdue_at } if !is_due(overdue_at, now) => {
                *cycle = Cycle::Waiting { not_before: at, overdue_at, answered: true };
            }
            Cycle::Ready { .. } | Cycle::Waiting { .. } => {}
        }
        Action::Nothing
    }

    fn on_drained(&mut self) -> Action {
        if let Order::Active { stage: Stage::Intake { flow: flow @ Flow::Full, .. }, .. } = &mut self.order {
            *flow = Flow::Asking;
            return Action::Drained;
        }
        Action::Nothing
    }

    fn on_executed(&mut self, number: u16, config: &RobotConfig) -> Option<Action> {
        let numbering = config.numbering();
        let Order::Active { stage, .. } = &mut self.order else { return None };
        let ahead = numbering.ahead(self.executed, number);
        if !numbering.contains(number) || !(1..=self.queued - self.executed).contains(&ahead) {
            return None;
        }
        match ahead {
            1 => {
                self.ahead.pass();
                self.executed += 1;
            }
            _ if config.acks == Acks::Individual && self.ahead.insert(ahead - 1) => {}
            _ => return None,
        }
        while self.ahead.contains(0) {
            self.ahead.pass();
            self.executed += 1;
        }
        // Even past the jobs that were queued again after the list was cleared.
        self.queued = self.queued.max(self.executed);
        match stage {
            Stage::Intake { recovery, .. } => *recovery = Recovery::Resting { failures: 0 },
            Stage::Clearing { failures, .. } => *failures = 0,
            Stage::Ending | Stage::Interrupted { .. } | Stage::Alarm => {}
        }
        Some(Action::Nothing)
    }

    /// Handles a settled queue. The motion task reports a job before it completes it: jobs executed before the queue has
    /// settled are reported soon after. Nothing is queued meanwhile.
    fn on_settled(&mut self, now: Duration, config: &RobotConfig) -> Action {
        match &mut self.order {
            Order::Active {
                stage: Stage::Clearing { reported_at, .. } | Stage::Interrupted { reported_at },
                ..
            } if config.keeps(Rule::SettledTwice) => {
                *reported_at = (*reported_at).min(now.saturating_add(timing::CPU_CYCLE));
                Action::Nothing
            }
            Order::Active { .. } | Order::Idle => self.settle(config),
        }
    }

    fn settle(&mut self, config: &RobotConfig) -> Action {
        let Order::Active { number, stage } = &mut self.order else { return Action::Nothing };
        let number = *number;
        match *stage {
            Stage::Clearing { failures, .. } => {
                self.queued = self.executed;
                let recovery = Recovery::Resting { failures };
                *stage = Stage::Intake { flow: Flow::Asking, gap: Gap::Rest, recovery };
                Action::Cleared
            }
            Stage::Interrupted { .. } => self.over(number, config),
            Stage::Ending if self.executed == self.queued => self.over(number, config),
            Stage::Ending | Stage::Intake { .. } | Stage::Alarm => Action::Nothing,
        }
    }

    fn over(&mut self, order: u16, config: &RobotConfig) -> Action {
        self.order = Order::Idle;
        self.queued = self.executed;
        if config.acks != Acks::Individual {
            // The end of the order reports it.
            self.acked = self.executed;
        }
        if let Starts::New { ended, .. } = &mut self.starts {
            ended.rotate_right(1);
            ended[0] = order;
        }
        self.ended = Some(EndedOrder { order, executed: config.numbering().number(self.executed) });
        (self.replies.status, self.replies.end, self.replies.pause) = (true, true, false);
        Action::Over
    }

    fn clear_queue(&mut self) -> Option<Action> {
        match &mut self.order {
            Order::Active { stage: stage @ (Stage::Intake { .. } | Stage::Alarm), .. } => {
                self.replies.status |= *stage == Stage::Alarm;
                *stage = Stage::Clearing { failures: 0, reported_at: Duration::MAX };
                Some(Action::Clear)
            }
            Order::Active { .. } | Order::Idle => None,
        }
    }

    pub(super) fn interrupt(&mut self) -> Option<Action> {
        match &mut self.order {
            Order::Active { stage: Stage::Interrupted { .. }, .. } | Order::Idle => None,
            Order::Active { stage, .. } => {
                *stage = Stage::Interrupted { reported_at: Duration::MAX };
                self.replies.status = true;
                Some(Action::Interrupt)
            }
        }
    }
}
