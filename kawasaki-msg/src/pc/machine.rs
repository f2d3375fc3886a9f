//! What a PC does: `on` for what has happened, and what is sent.

use core::time::Duration;

use robot_session::Unexpected;

use super::config::{PcConfig, PcRule, Takeover};
use super::state::{
    Action, CommandOutcome, Commands, Contents, Count, Input, JobSent, Known, Link, Machine, Order, Outcome,
    Reply, Report, Stage, Start,
};
use crate::content::FromPc;
use crate::phase::Phase;
use crate::timing::LATEST_DATAGRAM;

/// Where the messages of an answer go.
pub trait Answer {
    /// Whether a message found room.
    fn send(&mut self, message: FromPc) -> bool;

    /// The status: the order, its phase, the last job sent and the last one known to be executed.
    fn status(&mut self, order: u16, phase: Phase, sent: Option<u16>, executed: Option<u16>) -> bool;

    /// The command that waits first; whether it found room.
    fn command(&mut self, order: u16) -> bool;

    /// The job of a place in the order, counted from 0, under its number.
    fn job(&mut self, order: u16, number: u16, index: u32) -> JobSent;

    /// Whether the order has no job of this place, and no later one.
    fn is_end(&mut self, index: u32) -> bool;
}

impl<const WORDS: usize> Machine<WORDS> {
    /// A PC without an order that listens.
    pub fn new() -> Self {
        Self {
            link: Link::Listening,
            order: Order::Idle,
            count: Count::default(),
            commands: Commands::default(),
        }
    }

    /// What happens, and what is to be done about it.
    ///
    /// # Errors
    /// When the input is none that the state allows; nothing has changed then.
    pub fn on(&mut self, now: Duration, input: Input, config: &PcConfig<'_>) -> Result<Action, Unexpected> {
        let unexpected = Unexpected { state: self.name(), input: input.name() };
        let action = match input {
            Input::Connected => Some(self.on_connected(now, config)),
            Input::Disconnected => Some(self.on_disconnected()),
            Input::Timeout => {
                self.on_timeout(now, config);
                Some(Action::Nothing)
            }
            Input::Received => self.on_received(now, config),
            Input::Message(message) => self.is_connected().then(|| self.on_report(now, message, config)),
            Input::Corrupt => self.on_corrupt(config),
            Input::ReadEnd { whole } => self.on_read_end(now, whole, config),
            Input::Start { order } => self.on_start(order, config),
            Input::Resume { order, executed, sent } => self.on_resume(order, executed, sent, config),
            Input::End => self.on_end(),
            Input::Interrupt => self.on_interrupt(config),
            Input::Command => self.on_command(),
        };
        action.ok_or(unexpected)
    }

    /// The answer, if it is due.
    pub fn transmit(&mut self, now: Duration, config: &PcConfig<'_>, answer: &mut impl Answer) -> bool {
        let Link::Connected { reply, robot, .. } = &mut self.link else { return false };
        let Reply::Due { at, contents } = *reply else { return false };
        if now < at {
            return false;
        }
        // Cleared before the answer is made: what comes later is a new reason to answer.
        *reply = Reply::Nothing;
        let robot = *robot;
        let numbering = config.numbering();
        self.end_when_done(config, answer);
        let number = self.order.number();
        let mut filled = false;
        if contents.status {
            let (sent, executed) = (numbering.number(self.count.sent), numbering.number(self.count.executed));
            filled |= answer.status(number, self.phase(), sent, executed);
        }
        filled |= self.command_robot(now, robot, config, answer);
        while self.commands.waiting > 0 && answer.command(number) {
            (self.commands.waiting, self.commands.in_flight) =
                (self.commands.waiting - 1, self.commands.in_flight + 1);
            filled = true;
        }
        if let Some(from) = contents.jobs_from {
            filled |= self.send_jobs(from, config, answer);
        }
        if !filled {
            answer.send(FromPc::Filler);
        }
        true
    }

    /// What is to be reported of the state; `None` when it all was.
    pub fn report(&mut self) -> Option<Report> {
        if let Link::Connected { close, .. } = &mut self.link
            && core::mem::take(close)
        {
            return Some(Report::Disconnect);
        }
        core::mem::take(&mut self.count.is_news).then_some(Report::Progress)
    }

    /// When [`Input::Timeout`] or an answer is due; `None` if only the robot or the caller can make something happen.
    pub fn deadline(&self) -> Option<Duration> {
        let Link::Connected { silent_at, reply, .. } = self.link else { return None };
        let at = if let Reply::Due { at, .. } = reply { at } else { Duration::MAX };
        let start = match self.order {
            Order::Starting { start: Start::Sent { answer_by }, .. } => answer_by,
            Order::Starting { .. } | Order::Running { .. } | Order::Idle => Duration::MAX,
        };
        Some(silent_at.min(at).min(start)).filter(|at| *at != Duration::MAX)
    }

    /// Visits every time in the state.
    pub fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        if let Link::Connected { silent_at, reply, .. } = &mut self.link {
            f(silent_at);
            if let Reply::Due { at, .. } = reply {
                f(at);
            }
        }
        match &mut self.order {
            Order::Starting { start: Start::Sent { answer_by }, .. } => f(answer_by),
            Order::Running { left_at, .. } => f(left_at),
            Order::Starting { .. } | Order::Idle => {}
        }
    }

    /// The state's name: that of the order, or of the connection where there is no order.
    pub const fn name(&self) -> &'static str {
        match (&self.order, &self.link) {
            (Order::Idle, Link::Listening) => "Listening",
            (Order::Idle, Link::Connected { .. }) => "Idle",
            (Order::Starting { cancelled: true, .. }, _) => "Cancelled",
            (Order::Starting { start, .. }, _) => match start {
                Start::Unsent => "Starting",
                Start::Lost => "StartLost",
                Start::Sent { .. } => "StartSent",
                Start::Foreign { .. } => "OtherOrderEnds",
            },
            (Order::Running { stage: Stage::Active, .. }, _) => "Active",
            (Order::Running { stage: Stage::Ending, .. }, _) => "Ending",
            (Order::Running { stage: Stage::Interrupted, .. }, _) => "Interrupted",
        }
    }

    /// How far the order is, as the status reports it.
    pub const fn phase(&self) -> Phase {
        match self.order {
            Order::Idle => Phase::Idle,
            Order::Starting { .. } => Phase::Starting,
            Order::Running { stage: Stage::Active, .. } => Phase::Active,
            Order::Running { stage: Stage::Ending, .. } => Phase::Ending,
            Order::Running { stage: Stage::Interrupted, .. } => Phase::Interrupted,
        }
    }

    /// There is a connection.
    pub const fn is_connected(&self) -> bool {
        matches!(self.link, Link::Connected { .. })
    }

    fn on_connected(&mut self, now: Duration, config: &PcConfig<'_>) -> Action {
        let action = self.on_disconnected();
        let silent_at = now.saturating_add(config.silence);
        self.link = Link::Connected { silent_at, reply: Reply::Nothing, robot: Known::Nothing, close: false };
        action
    }

    fn on_disconnected(&mut self) -> Action {
        self.link = Link::Listening;
        if let Order::Starting { start: start @ Start::Sent { .. }, .. } = &mut self.order {
            *start = Start::Lost;
        }
        self.commands_end(CommandOutcome::Unknown)
    }

    fn commands_end(&mut self, outcome: CommandOutcome) -> Action {
        match core::mem::take(&mut self.commands.in_flight) {
            0 => Action::Nothing,
            count => Action::Commands { count, outcome },
        }
    }

    fn on_timeout(&mut self, now: Duration, config: &PcConfig<'_>) {
        let Link::Connected { silent_at, close, .. } = &mut self.link else { return };
        if let Order::Starting { start: start @ Start::Sent { .. }, .. } = &mut self.order
            && let Start::Sent { answer_by } = start
            && now >= *answer_by
        {
            if config.datagrams {
                *start = Start::Lost;
            } else {
                *answer_by = Duration::MAX;
                *close = true;
            }
        }
        if now >= *silent_at {
            *silent_at = now.saturating_add(config.silence);
            *close = true;
        }
    }

    fn on_received(&mut self, now: Duration, config: &PcConfig<'_>) -> Option<Action> {
        let Link::Connected { silent_at, reply, .. } = &mut self.link else { return None };
        *silent_at = now.saturating_add(config.silence);
        *reply = match *reply {
            Reply::Nothing => Reply::Receiving { contents: Contents::default() },
            Reply::Receiving { contents } | Reply::Due { contents, .. } => Reply::Receiving { contents },
        };
        Some(self.commands_end(CommandOutcome::Transmitted))
    }

    /// An acknowledgement may be lost in them.
    fn on_corrupt(&mut self, config: &PcConfig<'_>) -> Option<Action> {
        if !self.is_connected() {
            return None;
        }
        self.doubt(config);
        Some(Action::Nothing)
    }

    pub(super) fn doubt(&mut self, config: &PcConfig<'_>) {
        if matches!(self.order, Order::Running { .. }) && config.keeps(PcRule::DoubtCorrupt) {
            self.count.is_unsure |= !config.cumulative_acks;
        }
    }

    /// The whole of what has come is read before it is answered (thesis, section 11.3).
    fn on_read_end(&mut self, now: Duration, whole: bool, config: &PcConfig<'_>) -> Option<Action> {
        let Link::Connected { reply, .. } = &mut self.link else { return None };
        *reply = match *reply {
            Reply::Nothing => Reply::Nothing,
            Reply::Receiving { contents } | Reply::Due { contents, .. } if whole => {
                Reply::Due { at: now.saturating_add(config.reply_delay), contents }
            }
            Reply::Receiving { contents } | Reply::Due { contents, .. } => Reply::Receiving { contents },
        };
        Some(Action::Nothing)
    }

    fn on_start(&mut self, order: u16, config: &PcConfig<'_>) -> Option<Action> {
        if self.order != Order::Idle || order == 0 {
            return None;
        }
        let start = match self.link {
            // It is not ours, also where it has no jobs: some may be executed ahead.
            Link::Connected { robot: Known::In { order: active }, .. }
                if active == order && config.keeps(PcRule::LearnIdentity) =>
            {
                Start::Foreign { order }
            }
            Link::Connected { .. } | Link::Listening => Start::Unsent,
        };
        self.order = Order::Starting { number: order, start, refusals: 0, cancelled: false };
        self.count = Count::default();
        Some(Action::Nothing)
    }

    /// The state of a PC whose connection was lost after its last packet: the robot's status shows what became of the order.
    fn on_resume(&mut self, order: u16, executed: u32, sent: u32, config: &PcConfig<'_>) -> Option<Action> {
        let in_flight = sent.checked_sub(executed)?;
        if self.order != Order::Idle || order == 0 || in_flight > config.window() {
            return None;
        }
        self.order = Order::Running { number: order, stage: Stage::Active, left_at: Duration::MAX };
        // Nobody has kept whether corrupt bytes came.
        let is_unsure = !config.cumulative_acks && config.keeps(PcRule::DoubtCorrupt);
        self.count = Count { executed, queued: executed, sent, is_unsure, ..Count::default() };
        Some(Action::Nothing)
    }

    fn on_end(&mut self) -> Option<Action> {
        let Order::Running { stage: stage @ Stage::Active, .. } = &mut self.order else { return None };
        *stage = Stage::Ending;
        Some(Action::Nothing)
    }

    fn on_interrupt(&mut self, config: &PcConfig<'_>) -> Option<Action> {
        match &mut self.order {
            Order::Starting { number, .. } if !config.keeps(PcRule::CancelWaits) => {
                let (number, left_at) = (*number, Duration::MAX);
                self.order = Order::Running { number, stage: Stage::Interrupted, left_at };
            }
            Order::Starting { start: Start::Unsent | Start::Foreign { .. }, .. } => {
                return Some(self.not_begun());
            }
            Order::Starting { cancelled: cancelled @ false, .. } => *cancelled = true,
            Order::Running { stage: stage @ (Stage::Active | Stage::Ending), .. } => {
                *stage = Stage::Interrupted;
            }
            Order::Running { .. } | Order::Starting { .. } | Order::Idle => return None,
        }
        Some(Action::Nothing)
    }

    /// The caller has interrupted a start that the robot does not have.
    pub(super) fn not_begun(&mut self) -> Action {
        self.order = Order::Idle;
        Action::Outcome(Outcome::Over { executed: 0, complete: false })
    }

    fn on_command(&mut self) -> Option<Action> {
        let Commands { in_flight, waiting } = self.commands;
        if in_flight + waiting >= Commands::MAX {
            return None;
        }
        self.commands.waiting += 1;
        Some(Action::Nothing)
    }

    fn end_when_done(&mut self, config: &PcConfig<'_>, answer: &mut impl Answer) {
        if let Order::Running { stage: stage @ Stage::Active, .. } = &mut self.order
            && config.end_when_done
            && self.count.executed == self.count.sent
            && answer.is_end(self.count.sent)
        {
            self.count.total = Some(self.count.sent);
            *stage = Stage::Ending;
        }
    }

    /// What the order asks of the robot, in every answer until the robot has acknowledged it: received twice, it does no harm.
    ///
    /// But for a start: one that is still in flight when the robot has taken the first and been reset begins the order again. Over
    /// a stream it is sent once on a connection.
    fn command_robot(
        &mut self,
        now: Duration,
        robot: Known,
        config: &PcConfig<'_>,
        answer: &mut impl Answer,
    ) -> bool {
        match &mut self.order {
            Order::Starting { start: Start::Sent { answer_by }, cancelled: true, .. } if config.datagrams => {
                // The start may be lost. From then on a report is newer than the latest that it can arrive.
                *answer_by =
                    (*answer_by).min(now.saturating_add(LATEST_DATAGRAM).saturating_add(LATEST_DATAGRAM));
                false
            }
            Order::Idle
            | Order::Starting { cancelled: true, .. }
            | Order::Running { stage: Stage::Active, .. } => false,
            Order::Starting { number, start, .. } => match *start {
                Start::Unsent | Start::Lost
                    if robot == Known::Nothing && config.keeps(PcRule::LearnIdentity) =>
                {
                    false
                }
                Start::Sent { .. } if !config.datagrams && config.keeps(PcRule::StartOnce) => false,
                Start::Unsent | Start::Lost | Start::Sent { .. } => {
                    let sent = answer.send(FromPc::Start { order: *number, first: 1 });
                    if sent {
                        let wait = if config.datagrams || !config.keeps(PcRule::StartOnce) {
                            Duration::MAX
                        } else {
                            config.silence
                        };
                        *start = Start::Sent { answer_by: now.saturating_add(wait) };
                    }
                    sent
                }
                Start::Foreign { order } => match config.takeover {
                    // The next status ends it.
                    Takeover::Never => false,
                    Takeover::End => answer.send(FromPc::End { order }),
                    Takeover::Interrupt => answer.send(FromPc::Interrupt { order }),
                },
            },
            Order::Running { number, stage: Stage::Ending, .. } => {
                answer.send(FromPc::End { order: *number })
            }
            Order::Running { number, stage: Stage::Interrupted, .. } => {
                answer.send(FromPc::Interrupt { order: *number })
            }
        }
    }

    /// As many jobs as fit, and no more than the numbers can tell apart.
    fn send_jobs(&mut self, from: u32, config: &PcConfig<'_>, answer: &mut impl Answer) -> bool {
        let Order::Running { number: order, stage: Stage::Active, .. } = self.order else { return false };
        let (numbering, window) = (config.numbering(), config.window());
        // What was executed since it was requested is never sent again.
        let from = from.max(self.count.executed);
        let mut index = from;
        while index - self.count.executed < window {
            match answer.job(order, numbering.next(index), index) {
                JobSent::Sent => {
                    index += 1;
                    self.count.sent = self.count.sent.max(index);
                }
                JobSent::NoRoom | JobSent::Later => break,
                JobSent::End => {
                    self.count.total = Some(index);
                    break;
                }
            }
        }
        index > from
    }
}

impl<const WORDS: usize> Default for Machine<WORDS> {
    fn default() -> Self {
        Self::new()
    }
}
