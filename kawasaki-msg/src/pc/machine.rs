//! The machine of a PC: its reaction to each input, and its answers.

use core::time::Duration;

use robot_session::Unexpected;
use robot_session::end::{Expiry, is_due};

use super::config::{PcConfig, Rule, Takeover};
pub use super::state::{
    Action, Answer, CommandOutcome, Commands, Contents, Count, Input, Link, Machine, Order, Outcome,
    Reaction, Rejection, Reply, Report, RobotOrder, SentAnswer, Stage, Start, UnsentJobs,
};
use crate::content::{FromPc, FromRobot, Status};
use crate::phase::Phase;
use crate::timing::LATEST_DATAGRAM;

impl robot_session::end::Machine for Machine {
    const END: &'static str = "pc";
    const EXPIRY: Expiry = Expiry::Last;
    type Input = Input;
    type Action = Reaction;
    type Transmit = Answer;
    type Config = PcConfig;

    /// # Errors
    /// There is no connection, or no order for this input, or too many commands wait.
    fn on(&mut self, now: Duration, input: Input, config: &PcConfig) -> Result<Reaction, Unexpected> {
        let outcome = match input {
            Input::Message(_) => Some(CommandOutcome::Transmitted),
            Input::Connected | Input::Disconnected => Some(CommandOutcome::Unknown),
            _ => None,
        };
        let action = match input {
            Input::Connected => Some(self.on_connected(now, config)),
            Input::Disconnected => Some(self.on_disconnected()),
            Input::Timeout => {
                self.on_timeout(now, config);
                Some(Action::Nothing)
            }
            Input::Message(message) => self.on_message(now, message, config),
            Input::Corrupt => self.on_corrupt(config),
            Input::ReadEnd { whole } => self.on_read_end(now, whole, config),
            Input::Start { order } => self.on_start(order, config),
            Input::Resume { order, executed, sent, total } => {
                self.on_resume(order, executed, sent, total, config)
            }
            Input::Ahead { index } => self.on_ahead(index, config),
            Input::End => self.on_end(),
            Input::Interrupt => self.on_interrupt(config),
            Input::Command => self.on_command(),
            Input::Sent(sent) => self.on_sent(now, sent, config),
            Input::Reported => self.on_reported(),
        };
        let action = action.ok_or_else(|| self.unexpected(&input))?;
        let commands = outcome.map(|outcome| (core::mem::take(&mut self.commands.in_flight), outcome));
        Ok(Reaction { commands: commands.unwrap_or((0, CommandOutcome::Unknown)), action })
    }

    /// Returns the answer that is due. It covers inputs that came after it was due.
    fn transmit(&self, now: Duration, config: &PcConfig) -> Option<Answer> {
        let Link::Connected { reply: Reply::Due { at, contents }, .. } = self.link else { return None };
        if !is_due(at, now) {
            return None;
        }
        let Count { executed, sent, .. } = self.count;
        let numbering = config.numbering();
        let is_active = matches!(self.order, Order::Running { stage: Stage::Active, .. });
        // Jobs that were executed since they were requested are never sent again.
        let jobs = contents.jobs_from.map(|from| (from.max(executed), executed + config.window()));
        Some(Answer {
            last: (is_active && config.end_when_done && executed == sent).then_some(sent),
            order: self.order.number(),
            status: contents.status.then(|| Status {
                order: self.order.number(),
                phase: self.phase(),
                queued: numbering.number(sent),
                executed: numbering.number(executed),
                ended: 0,
            }),
            request: self.request(config),
            commands: self.commands.waiting,
            jobs: jobs.filter(|_| is_active),
        })
    }

    fn deadline(&self) -> Option<Duration> {
        let Link::Connected { silent_at, reply, .. } = self.link else { return None };
        let at = if let Reply::Due { at, .. } = reply { at } else { Duration::MAX };
        Some(silent_at.min(at).min(self.answer_by())).filter(|at| *at != Duration::MAX)
    }

    fn expires(&self, now: Duration) -> bool {
        let Link::Connected { silent_at, .. } = self.link else { return false };
        is_due(silent_at.min(self.answer_by()), now)
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
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

    /// Returns the name of the order's state, or of the connection's if there is no order.
    fn name(&self) -> &'static str {
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
}

impl Machine {
    /// Returns the change that is to be reported to the caller; `None` if all were.
    pub const fn report(&self) -> Option<Report> {
        match self.link {
            Link::Connected { close: true, .. } => Some(Report::Disconnect),
            _ if self.count.is_news => Some(Report::Progress),
            _ => None,
        }
    }

    fn on_reported(&mut self) -> Option<Action> {
        match (self.report()?, &mut self.link) {
            (Report::Disconnect, Link::Connected { close, .. }) => *close = false,
            _ => self.count.is_news = false,
        }
        Some(Action::Nothing)
    }

    /// Returns the time by which a start that was sent must be answered, or cannot arrive any more.
    const fn answer_by(&self) -> Duration {
        match self.order {
            Order::Starting { start: Start::Sent { answer_by }, .. } => answer_by,
            Order::Starting { .. } | Order::Running { .. } | Order::Idle => Duration::MAX,
        }
    }

    /// Returns the phase of the order, as the status reports it.
    pub const fn phase(&self) -> Phase {
        match self.order {
            Order::Idle => Phase::Idle,
            Order::Starting { .. } => Phase::Starting,
            Order::Running { stage: Stage::Active, .. } => Phase::Active,
            Order::Running { stage: Stage::Ending, .. } => Phase::Ending,
            Order::Running { stage: Stage::Interrupted, .. } => Phase::Interrupted,
        }
    }

    /// Returns whether there is a connection.
    pub const fn is_connected(&self) -> bool {
        matches!(self.link, Link::Connected { .. })
    }

    fn on_connected(&mut self, now: Duration, config: &PcConfig) -> Action {
        self.on_disconnected();
        let silent_at = now.saturating_add(config.silence);
        self.link =
            Link::Connected { silent_at, reply: Reply::Nothing, robot: RobotOrder::Nothing, close: false };
        Action::Nothing
    }

    fn on_disconnected(&mut self) -> Action {
        self.link = Link::Listening;
        if let Order::Starting { start: start @ Start::Sent { .. }, .. } = &mut self.order {
            *start = Start::Lost;
        }
        Action::Nothing
    }

    fn on_timeout(&mut self, now: Duration, config: &PcConfig) {
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
            *silent_at = now.saturating_add(config.silence.max(Duration::from_nanos(1)));
            *close = true;
        }
    }

    fn on_message(&mut self, now: Duration, message: FromRobot, config: &PcConfig) -> Option<Action> {
        let Link::Connected { silent_at, reply, .. } = &mut self.link else { return None };
        *silent_at = now.saturating_add(config.silence);
        *reply = match *reply {
            Reply::Nothing => Reply::Receiving { contents: Contents::default() },
            Reply::Receiving { contents } | Reply::Due { contents, .. } => Reply::Receiving { contents },
        };
        Some(self.on_report(now, message, config))
    }

    /// Handles corrupt bytes, in which an acknowledgement may be lost.
    fn on_corrupt(&mut self, config: &PcConfig) -> Option<Action> {
        if !self.is_connected() {
            return None;
        }
        self.doubt(config);
        Some(Action::Nothing)
    }

    pub(super) fn doubt(&mut self, config: &PcConfig) {
        if matches!(self.order, Order::Running { .. }) && config.keeps(Rule::DoubtCorrupt) {
            self.count.is_unsure |= !config.cumulative_acks;
        }
    }

    /// Handles the end of a read: all bytes that have come are read before they are answered (thesis, section 11.3).
    fn on_read_end(&mut self, now: Duration, whole: bool, config: &PcConfig) -> Option<Action> {
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

    fn on_start(&mut self, order: u16, config: &PcConfig) -> Option<Action> {
        if self.order != Order::Idle || order == 0 {
            return None;
        }
        let start = match self.link {
            // The order is another's, even if it has no jobs: some may be executed ahead.
            Link::Connected { robot: RobotOrder::In { order: active }, .. }
                if active == order && config.keeps(Rule::LearnIdentity) =>
            {
                Start::Foreign { order }
            }
            Link::Connected { .. } | Link::Listening => Start::Unsent,
        };
        self.order = Order::Starting { number: order, start, refusals: 0, cancelled: false };
        self.count = Count::default();
        Some(Action::Nothing)
    }

    /// Resumes in the state of a PC whose connection was lost after its last packet: the robot's status shows the outcome of
    /// the order.
    fn on_resume(
        &mut self,
        order: u16,
        executed: u32,
        sent: u32,
        total: Option<u32>,
        config: &PcConfig,
    ) -> Option<Action> {
        let in_flight = sent.checked_sub(executed)?;
        if self.order != Order::Idle || order == 0 || in_flight > config.window() {
            return None;
        }
        self.order = Order::Running { number: order, stage: Stage::Active, left_at: Duration::MAX };
        // It was not stored whether corrupt bytes came.
        let is_unsure = !config.cumulative_acks && config.keeps(Rule::DoubtCorrupt);
        self.count = Count { executed, queued: executed, sent, total, is_unsure, ..Count::default() };
        Some(Action::Nothing)
    }

    /// Handles a job executed ahead, only if jobs are acknowledged individually.
    fn on_ahead(&mut self, index: u32, config: &PcConfig) -> Option<Action> {
        let Order::Running { stage: Stage::Active, .. } = self.order else { return None };
        let Count { executed, sent, .. } = self.count;
        if !config.cumulative_acks && (executed..sent).contains(&index) {
            self.count.ahead.insert(index - executed);
        }
        Some(Action::Nothing)
    }

    fn on_end(&mut self) -> Option<Action> {
        let Order::Running { stage: stage @ Stage::Active, .. } = &mut self.order else { return None };
        *stage = Stage::Ending;
        Some(Action::Nothing)
    }

    fn on_interrupt(&mut self, config: &PcConfig) -> Option<Action> {
        match &mut self.order {
            Order::Starting { number, .. } if !config.keeps(Rule::CancelWaits) => {
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

    /// Handles the caller's interruption of a start that the robot does not have.
    pub(super) fn not_begun(&mut self) -> Action {
        let order = core::mem::replace(&mut self.order, Order::Idle).number();
        Action::Outcome { order, outcome: Outcome::Over { executed: 0, complete: false } }
    }

    fn on_command(&mut self) -> Option<Action> {
        let Commands { in_flight, waiting } = self.commands;
        if in_flight + waiting >= Commands::MAX {
            return None;
        }
        self.commands.waiting += 1;
        Some(Action::Nothing)
    }

    /// Returns the order's request to the robot. It is in every answer until the robot has acknowledged it: received twice,
    /// it does no harm.
    ///
    /// A start is an exception: if one is still in flight when the robot has accepted the first and was then reset, it begins
    /// the order again. Over a stream it is sent once per connection.
    fn request(&self, config: &PcConfig) -> Option<FromPc> {
        let Link::Connected { robot, .. } = self.link else { return None };
        match self.order {
            Order::Idle
            | Order::Starting { cancelled: true, .. }
            | Order::Running { stage: Stage::Active, .. } => None,
            Order::Starting { number, start, .. } => match start {
                Start::Unsent | Start::Lost
                    if robot == RobotOrder::Nothing && config.keeps(Rule::LearnIdentity) =>
                {
                    None
                }
                Start::Sent { .. } if !config.datagrams && config.keeps(Rule::StartOnce) => None,
                Start::Unsent | Start::Lost | Start::Sent { .. } => {
                    Some(FromPc::Start { order: number, first: 1 })
                }
                Start::Foreign { order } => match config.takeover {
                    // The next status ends it.
                    Takeover::Never => None,
                    Takeover::End => Some(FromPc::End { order }),
                    Takeover::Interrupt => Some(FromPc::Interrupt { order }),
                },
            },
            Order::Running { number, stage: Stage::Ending, .. } => Some(FromPc::End { order: number }),
            Order::Running { number, stage: Stage::Interrupted, .. } => {
                Some(FromPc::Interrupt { order: number })
            }
        }
    }

    fn on_sent(&mut self, now: Duration, sent: SentAnswer, config: &PcConfig) -> Option<Action> {
        let request = self.request(config).filter(|_| sent.request);
        let Link::Connected { reply: reply @ Reply::Due { .. }, .. } = &mut self.link else { return None };
        let Reply::Due { contents, .. } = core::mem::replace(reply, Reply::Nothing) else { return None };
        let wait =
            if config.datagrams || !config.keeps(Rule::StartOnce) { Duration::MAX } else { config.silence };
        match &mut self.order {
            Order::Starting { start: Start::Sent { answer_by }, cancelled: true, .. } if config.datagrams => {
                // The start may be lost. From this time on, a report is newer than the latest possible arrival of the start.
                *answer_by =
                    (*answer_by).min(now.saturating_add(LATEST_DATAGRAM).saturating_add(LATEST_DATAGRAM));
            }
            Order::Starting { start, .. } if matches!(request, Some(FromPc::Start { .. })) => {
                *start = Start::Sent { answer_by: now.saturating_add(wait) };
            }
            Order::Idle | Order::Starting { .. } | Order::Running { .. } => {}
        }
        let commands = sent.commands.min(self.commands.waiting);
        self.commands.waiting -= commands;
        self.commands.in_flight += commands;
        if let Order::Running { stage: stage @ Stage::Active, .. } = &mut self.order {
            let Count { executed, sent: before, .. } = self.count;
            let index = contents.jobs_from.map_or(before, |from| from.max(executed) + sent.jobs);
            self.count.sent = before.max(index);
            match sent.rest {
                UnsentJobs::Later => {}
                UnsentJobs::End => {
                    self.count.total = Some(index);
                    if config.end_when_done && executed == index {
                        *stage = Stage::Ending;
                    }
                }
                // The jobs before it are executed; no later one is ever asked for.
                UnsentJobs::Unfit => *stage = Stage::Ending,
            }
        }
        Some(Action::Sent)
    }
}
