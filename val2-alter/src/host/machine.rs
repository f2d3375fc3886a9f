//! The host's machine: everything that decides what the host does, and nothing else. Values of axes are not in it: it knows
//! which words may be other than zero.

use core::time::Duration;

use robot_session::Unexpected;

use super::config::{ExceptionOutcome, HostConfig, HostRule, LostReason, Policy, UnknownReason};
use crate::error::SessionError;
use crate::frame::DLE;
use crate::message::{AXES, Accumulation, ErrorCode, Exception, MotionPhase, StartCode};
use crate::timing::{CYCLE, transmission, window};

/// The state of a host.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct HostMachine {
    /// What is going on.
    pub phase: HostPhase,
    /// How start messages are answered.
    pub policy: Policy,
    /// Whether an exception subroutine is installed.
    pub subroutine: bool,
    /// When a silence ends the frame that has begun.
    pub gap_at: Option<Duration>,
}

/// What is going on.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum HostPhase {
    /// The port is not open.
    Disconnected,
    /// No ALTER.
    Idle,
    /// What may have been a start message was corrupt.
    Repeating {
        /// How often in a row it was asked for again.
        asked: u8,
        /// The answer that is due.
        answer: Option<Due>,
        /// When the count begins anew.
        forget_at: Duration,
    },
    /// A start message is not answered yet.
    Starting {
        /// Whether it names the configured mode.
        is_expected: bool,
        /// The answer that is due.
        answer: Due,
    },
    /// A start message was accepted.
    Active(Active),
    /// The host has stopped: no message is answered.
    Silent {
        /// When the controller counts as lost.
        lost_at: Duration,
    },
}

/// An ALTER.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Active {
    /// How far it is.
    pub stage: Stage,
    /// The message to be answered.
    pub request: Option<Request>,
    /// When the controller counts as lost.
    pub lost_at: Duration,
    /// Whether the values follow the caller.
    pub target: Target,
    /// The caller's exception.
    pub exception: Pending,
    /// Bit *i*: the controller may hold a word *i* that is not zero, whatever it makes of words that are left out.
    pub kept: u8,
    /// The same if it has read the last reply.
    pub sent: u8,
}

/// How far an ALTER is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stage {
    /// No standard message came yet.
    Accepted,
    /// The values follow the caller.
    Running,
    /// The exception subroutine runs: the values brake.
    Interrupted,
    /// The caller has stopped: the values go to zero.
    Stopping {
        /// The last reply was all zeros, at rest.
        zeros_sent: bool,
    },
}

/// Whether the values follow the caller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Target {
    /// No target was set.
    Unset,
    /// A target was set.
    Fresh {
        /// How long it holds.
        until: Duration,
    },
    /// It is too old.
    Stale,
}

/// The caller's exception.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Pending {
    /// There is none.
    None,
    /// To be sent with the next reply.
    Unsent(Exception),
    /// Sent with the last reply.
    Sent {
        /// The code.
        exception: Exception,
        /// Until when the message that comes next is the one that follows directly.
        follows_until: Duration,
    },
}

/// When an answer must leave.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Due {
    /// The shortest answer must have begun.
    pub begin_by: Duration,
    /// The answer must have ended.
    pub end_by: Duration,
}

/// A standard message that is not answered yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Request {
    /// When the reply must leave.
    pub due: Due,
    /// Whether ALTER is interrupted.
    pub phase: MotionPhase,
    /// Until when a message is the next one.
    pub follows_until: Duration,
}

/// What the session understood.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum HostInput {
    /// The port was opened.
    Connected,
    /// The port is gone.
    Disconnected,
    /// Bytes came, and a frame has begun that is not whole, or not.
    Bytes {
        /// A frame has begun.
        partial: bool,
    },
    /// A start message of so many bytes, with the configured mode or another.
    Start {
        /// It names the configured mode.
        is_expected: bool,
        /// Its length.
        len: u8,
    },
    /// A standard message of so many bytes.
    Motion {
        /// Whether ALTER is interrupted.
        phase: MotionPhase,
        /// What was wrong with the last reply.
        error: ErrorCode,
        /// Its length.
        len: u8,
    },
    /// An end message.
    End,
    /// A corrupt frame.
    CorruptFrame,
    /// Bytes outside of any frame.
    Noise,
    /// Time has passed.
    Timeout,
    /// The answer can be sent.
    Transmit(Draft),
    /// The caller has set a target.
    Target,
    /// The caller has no target.
    NoTarget,
    /// The caller has an exception.
    Exception {
        /// The code.
        exception: Exception,
        /// There is room for the outcome.
        has_room: bool,
    },
    /// The caller stops.
    Stop,
    /// How start messages are answered from now on.
    Policy(Policy),
    /// Whether an exception subroutine is installed.
    Subroutine(bool),
}

/// The answer that could be sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Draft {
    /// Its length without words.
    pub bare: u8,
    /// The length of each word.
    pub words: [u8; AXES],
    /// Bit *i*: value *i* is not zero.
    pub moving: u8,
    /// No axis moves.
    pub at_rest: bool,
    /// There is room for the outcomes of an ALTER.
    pub has_room: bool,
}

/// What is to be answered: a draft is made from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Wanted {
    /// No answer: the start message is ignored.
    Nothing,
    /// The answer to a start message.
    Start(StartCode),
    /// The answer to a standard message.
    Reply {
        /// Where the values go.
        course: Course,
        /// The exception in it.
        exception: Exception,
    },
}

/// Where the values go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Course {
    /// To the caller's target.
    Target,
    /// To zero.
    Zero,
    /// An offset brakes and stays.
    Hold,
}

/// What the session is to do: everything that is set, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct HostActions {
    /// End the frame that has begun.
    pub end_frame: bool,
    /// A message was not answered in time: the arm is at rest.
    pub missed: bool,
    /// The controller could not read the last reply: the arm did not move by it.
    pub rejected: Option<ErrorCode>,
    /// Report that no target came.
    pub stale: bool,
    /// Report what became of an exception.
    pub outcome: Option<(Exception, ExceptionOutcome)>,
    /// Report that the stop is done.
    pub stopped: bool,
    /// ALTER has ended with an end message.
    pub ended: bool,
    /// ALTER is over without one.
    pub lost: Option<LostReason>,
    /// Send an answer.
    pub send: Option<Answer>,
    /// The caller's request is not possible.
    pub refused: Option<SessionError>,
}

/// An answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Answer {
    /// To a start message.
    Start(StartCode),
    /// To a standard message.
    Reply {
        /// The words to send.
        select: u8,
        /// The axes that must stay at zero, because their words do not fit.
        held: u8,
        /// The exception.
        exception: Exception,
    },
}

const ALL: u8 = (1 << AXES) - 1;

type Step = Result<HostActions, Unexpected>;

impl HostMachine {
    /// A host whose port is not open.
    pub const fn new(policy: Policy, subroutine: bool) -> Self {
        Self { phase: HostPhase::Disconnected, policy, subroutine, gap_at: None }
    }

    /// Takes an input; on an error nothing has changed.
    ///
    /// # Errors
    /// [`Unexpected`]: the port is not open, or there is nothing to transmit.
    pub fn on(&mut self, now: Duration, input: HostInput, config: &HostConfig) -> Step {
        use {HostInput as On, HostPhase as Is};
        let nothing = HostActions::default();
        let unexpected = Unexpected { state: self.name(), input: input.name() };
        match (&mut self.phase, input) {
            (_, On::Policy(policy)) => self.policy = policy,
            (_, On::Subroutine(installed)) => self.subroutine = installed,
            (_, On::Connected) => {
                let actions = self.over(LostReason::Disconnected);
                (self.phase, self.gap_at) = (Is::Idle, None);
                return Ok(actions);
            }
            (_, On::Disconnected) => {
                let actions = self.over(LostReason::Disconnected);
                (self.phase, self.gap_at) = (Is::Disconnected, None);
                return Ok(actions);
            }
            (_, On::Timeout) => return Ok(self.pass_time(now, config)),
            (_, On::Stop) => return Ok(self.stop(config)),
            (_, On::Exception { exception, has_room }) => {
                let refused = self.take_exception(exception, has_room).err();
                return Ok(HostActions { refused, ..nothing });
            }
            (Is::Active(active), On::Target) => {
                active.target = Target::Fresh { until: now.saturating_add(config.target_timeout) };
            }
            (Is::Active(active), On::NoTarget) => active.target = Target::Stale,
            (
                Is::Disconnected | Is::Idle | Is::Repeating { .. } | Is::Starting { .. } | Is::Silent { .. },
                On::Target | On::NoTarget,
            ) => {}
            (
                Is::Disconnected,
                On::Bytes { .. }
                | On::Start { .. }
                | On::Motion { .. }
                | On::End
                | On::CorruptFrame
                | On::Noise
                | On::Transmit(_),
            ) => return Err(unexpected),
            (_, On::Bytes { partial }) => {
                self.gap_at = config.gap.filter(|_| partial).map(|gap| now.saturating_add(gap));
            }
            (_, On::Start { is_expected, len: _ }) => return Ok(self.start(now, is_expected, config)),
            (_, On::End) => {
                let mut actions = self.over(LostReason::Silence);
                actions.ended = actions.lost.take().is_some();
                self.phase = Is::Idle;
                return Ok(actions);
            }
            // A message of an ALTER whose start was not received is not answered: its mode is not known.
            (Is::Idle | Is::Repeating { .. } | Is::Starting { .. }, On::Motion { .. }) => {}
            (Is::Silent { lost_at }, On::Motion { .. }) => *lost_at = lost(now, config),
            (Is::Active(active), On::Motion { phase, error, len }) => {
                let actions = active.motion(now, phase, error, len, config);
                if actions.stopped && config.keeps(HostRule::Silent) {
                    self.phase = Is::Silent { lost_at: lost(now, config) };
                }
                return Ok(actions);
            }
            (Is::Active(active), On::CorruptFrame | On::Noise) => active.lose_sequence(),
            (Is::Idle, On::CorruptFrame) => self.ask_again(now, 0, config),
            (Is::Repeating { asked, answer: None, .. }, On::CorruptFrame) => {
                let asked = *asked;
                self.ask_again(now, asked, config);
            }
            (Is::Repeating { answer: Some(_), .. }, On::CorruptFrame) => {}
            (Is::Starting { .. } | Is::Silent { .. }, On::CorruptFrame) => {}
            (Is::Idle | Is::Repeating { .. } | Is::Starting { .. } | Is::Silent { .. }, On::Noise) => {}
            (Is::Starting { .. } | Is::Repeating { answer: Some(_), .. }, On::Transmit(draft)) => {
                return Ok(self.answer_start(now, draft, config));
            }
            (Is::Active(Active { request: Some(_), .. }), On::Transmit(draft)) => {
                return Ok(self.reply(now, draft, config));
            }
            (
                Is::Idle
                | Is::Repeating { answer: None, .. }
                | Is::Active(Active { request: None, .. })
                | Is::Silent { .. },
                On::Transmit(_),
            ) => return Err(unexpected),
        }
        Ok(nothing)
    }

    /// What is to be answered.
    pub fn wanted(&self, config: &HostConfig) -> Option<Wanted> {
        match &self.phase {
            HostPhase::Starting { is_expected, .. } => match self.policy {
                Policy::Accept if *is_expected => Some(Wanted::Start(StartCode::Accept)),
                Policy::Accept | Policy::Refuse => Some(Wanted::Start(StartCode::Refuse)),
                Policy::Ignore => Some(Wanted::Nothing),
            },
            HostPhase::Repeating { asked, answer: Some(_), .. } => match self.policy {
                Policy::Accept if *asked <= config.repeats => Some(Wanted::Start(StartCode::Repeat)),
                Policy::Accept | Policy::Refuse => Some(Wanted::Start(StartCode::Refuse)),
                Policy::Ignore => Some(Wanted::Nothing),
            },
            HostPhase::Active(active) => {
                active.request?;
                let exception = match active.exception {
                    Pending::Unsent(exception)
                        if active.stage == Stage::Running || !config.keeps(HostRule::NotInterrupted) =>
                    {
                        exception
                    }
                    _ => Exception::None,
                };
                Some(Wanted::Reply { course: active.course(config), exception })
            }
            HostPhase::Disconnected
            | HostPhase::Idle
            | HostPhase::Repeating { answer: None, .. }
            | HostPhase::Silent { .. } => None,
        }
    }

    /// By when the answer that is due must begin to leave.
    pub fn reply_by(&self) -> Option<Duration> {
        match &self.phase {
            HostPhase::Starting { answer, .. } | HostPhase::Repeating { answer: Some(answer), .. } => {
                Some(answer.begin_by)
            }
            HostPhase::Active(active) => active.request.map(|request| request.due.begin_by),
            HostPhase::Disconnected
            | HostPhase::Idle
            | HostPhase::Repeating { answer: None, .. }
            | HostPhase::Silent { .. } => None,
        }
    }

    /// When [`HostInput::Timeout`] is due.
    pub fn deadline(&self) -> Option<Duration> {
        let other = match &self.phase {
            HostPhase::Repeating { forget_at, .. } => Some(*forget_at),
            HostPhase::Active(Active { lost_at, target: Target::Fresh { until }, .. }) => {
                Some(*lost_at.min(until))
            }
            HostPhase::Active(Active { lost_at, .. }) | HostPhase::Silent { lost_at } => Some(*lost_at),
            HostPhase::Disconnected | HostPhase::Idle | HostPhase::Starting { .. } => None,
        };
        [self.reply_by(), other, self.gap_at].into_iter().flatten().min()
    }

    /// Visits every time in the state.
    pub fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        self.gap_at.iter_mut().for_each(&mut f);
        let mut due = |due: &mut Due| {
            f(&mut due.begin_by);
            f(&mut due.end_by);
        };
        match &mut self.phase {
            HostPhase::Disconnected | HostPhase::Idle => {}
            HostPhase::Repeating { answer, forget_at, .. } => {
                answer.iter_mut().for_each(due);
                f(forget_at);
            }
            HostPhase::Starting { answer, .. } => due(answer),
            HostPhase::Silent { lost_at } => f(lost_at),
            HostPhase::Active(active) => {
                if let Some(request) = &mut active.request {
                    due(&mut request.due);
                    f(&mut request.follows_until);
                }
                if let Target::Fresh { until } = &mut active.target {
                    f(until);
                }
                if let Pending::Sent { follows_until, .. } = &mut active.exception {
                    f(follows_until);
                }
                f(&mut active.lost_at);
            }
        }
    }

    /// The state's name.
    pub const fn name(&self) -> &'static str {
        match &self.phase {
            HostPhase::Disconnected => "disconnected",
            HostPhase::Idle => "idle",
            HostPhase::Repeating { .. } => "repeating",
            HostPhase::Starting { .. } => "starting",
            HostPhase::Active(active) => match active.stage {
                Stage::Accepted => "accepted",
                Stage::Running => "running",
                Stage::Interrupted => "interrupted",
                Stage::Stopping { .. } => "stopping",
            },
            HostPhase::Silent { .. } => "silent",
        }
    }

    fn start(&mut self, now: Duration, is_expected: bool, config: &HostConfig) -> HostActions {
        let mut actions = HostActions::default();
        // The start message again: the answer to the one before was not read.
        let again = matches!(&self.phase, HostPhase::Active(active) if active.stage == Stage::Accepted);
        if config.keeps(HostRule::Restart) && !again {
            actions = self.over(LostReason::Restart);
        }
        actions.missed |= self.reply_by().is_some();
        let is_expected = is_expected || !config.keeps(HostRule::Mode);
        self.phase = HostPhase::Starting { is_expected, answer: answer_start(now, config) };
        actions
    }

    /// ALTER is over, if there is one: what the caller waits for ends.
    fn over(&mut self, reason: LostReason) -> HostActions {
        let mut actions = HostActions::default();
        match &self.phase {
            HostPhase::Active(active) => {
                actions.outcome = active.outcome_at_end();
                actions.lost = Some(reason);
            }
            HostPhase::Silent { .. } => actions.lost = Some(reason),
            HostPhase::Disconnected
            | HostPhase::Idle
            | HostPhase::Repeating { .. }
            | HostPhase::Starting { .. } => {}
        }
        actions
    }

    /// "Der externe Rechner hat einen Kommunikationsfehler entdeckt und erwartet, daß die Robotersteuerung die einleitende
    /// Nachricht wiederholt" (§3.3.1). A corrupt standard message has no such answer: the controller's timeout is its answer.
    fn ask_again(&mut self, now: Duration, asked: u8, config: &HostConfig) {
        if self.policy == Policy::Accept {
            let forget_at = if config.keeps(HostRule::Forget) { lost(now, config) } else { Duration::MAX };
            let answer = Some(answer_start(now, config));
            self.phase = HostPhase::Repeating { asked: asked.saturating_add(1), answer, forget_at };
        }
    }

    fn answer_start(&mut self, now: Duration, draft: Draft, config: &HostConfig) -> HostActions {
        let mut actions = HostActions::default();
        let Some(Wanted::Start(code)) = self.wanted(config) else {
            self.phase = HostPhase::Idle;
            return actions;
        };
        let due = match &mut self.phase {
            HostPhase::Starting { answer, .. } => Some(*answer),
            HostPhase::Repeating { answer, .. } => answer.take(),
            _ => None,
        };
        let fits = due.is_some_and(|due| fits(draft.bare.into(), Duration::ZERO, now, due.end_by, config));
        if !fits && config.keeps(HostRule::Late) {
            actions.missed = true;
            if matches!(self.phase, HostPhase::Starting { .. }) {
                self.phase = HostPhase::Idle;
            }
            return actions;
        }
        match code {
            // Without room for its outcomes no ALTER begins: the controller asks again.
            StartCode::Accept if !draft.has_room => self.phase = HostPhase::Idle,
            StartCode::Accept => {
                self.phase = HostPhase::Active(Active {
                    stage: Stage::Accepted,
                    request: None,
                    lost_at: lost(now, config),
                    target: Target::Unset,
                    exception: Pending::None,
                    kept: 0,
                    sent: 0,
                });
                actions.send = Some(Answer::Start(code));
            }
            StartCode::Repeat => actions.send = Some(Answer::Start(code)),
            StartCode::Refuse => {
                self.phase = HostPhase::Idle;
                actions.send = Some(Answer::Start(code));
            }
        }
        actions
    }

    fn reply(&mut self, now: Duration, draft: Draft, config: &HostConfig) -> HostActions {
        let wanted = self.wanted(config);
        let mut actions = HostActions::default();
        let HostPhase::Active(active) = &mut self.phase else { return actions };
        let (Some(request), Some(Wanted::Reply { exception, .. })) = (active.request.take(), wanted) else {
            return actions;
        };
        let Some((select, held)) = active.select(now, draft, request.due.end_by, config) else {
            actions.missed = true;
            return actions;
        };
        active.sent = draft.moving & select;
        if request.phase == MotionPhase::Interrupted && config.keeps(HostRule::WordsInterrupted) {
            // Nobody knows whether a controller keeps the words that come while its subroutine runs.
            active.kept |= active.sent;
            active.sent = active.kept;
        }
        if exception != Exception::None {
            active.exception = Pending::Sent { exception, follows_until: request.follows_until };
        }
        if let Stage::Stopping { zeros_sent } = &mut active.stage {
            *zeros_sent = draft.moving == 0 && draft.at_rest;
        }
        actions.send = Some(Answer::Reply { select, held, exception });
        actions
    }

    fn pass_time(&mut self, now: Duration, config: &HostConfig) -> HostActions {
        let mut actions = HostActions::default();
        let is_due = |at: &Duration| *at <= now;
        if self.gap_at.as_ref().is_some_and(is_due) {
            self.gap_at = None;
            actions.end_frame = true;
        }
        match &mut self.phase {
            HostPhase::Disconnected | HostPhase::Idle => {}
            HostPhase::Repeating { answer, forget_at, .. } => {
                actions.missed = answer.take_if(|due| is_due(&due.begin_by)).is_some();
                if is_due(forget_at) {
                    self.phase = HostPhase::Idle;
                }
            }
            HostPhase::Starting { answer, .. } if is_due(&answer.begin_by) => {
                actions.missed = true;
                self.phase = HostPhase::Idle;
            }
            HostPhase::Starting { .. } => {}
            HostPhase::Active(active) => {
                let missed = active.request.take_if(|request| is_due(&request.due.begin_by));
                actions.missed = missed.is_some();
                if matches!(&active.target, Target::Fresh { until } if is_due(until)) {
                    active.target = Target::Stale;
                    actions.stale = true;
                }
                if is_due(&active.lost_at) && config.keeps(HostRule::Lost) {
                    actions.lost = Some(LostReason::Silence);
                    actions.outcome = active.outcome_at_end();
                    self.phase = HostPhase::Idle;
                }
            }
            HostPhase::Silent { lost_at } if is_due(lost_at) => {
                actions.lost = Some(LostReason::Silence);
                self.phase = HostPhase::Idle;
            }
            HostPhase::Silent { .. } => {}
        }
        actions
    }

    fn stop(&mut self, config: &HostConfig) -> HostActions {
        let mut actions = HostActions::default();
        self.policy = Policy::Ignore;
        match &mut self.phase {
            HostPhase::Active(active) if active.stage == Stage::Accepted => {
                actions.stopped = true;
                self.phase = HostPhase::Silent { lost_at: active.lost_at };
            }
            HostPhase::Active(active) => {
                if let Pending::Unsent(exception) = active.exception {
                    actions.outcome = Some((exception, ExceptionOutcome::NotDone));
                    active.exception = Pending::None;
                }
                if !matches!(active.stage, Stage::Stopping { .. }) {
                    active.stage = Stage::Stopping { zeros_sent: !config.keeps(HostRule::ZerosRead) };
                }
            }
            HostPhase::Repeating { .. } | HostPhase::Starting { .. } => self.phase = HostPhase::Idle,
            HostPhase::Disconnected | HostPhase::Idle | HostPhase::Silent { .. } => {}
        }
        actions
    }

    fn take_exception(&mut self, exception: Exception, has_room: bool) -> Result<(), SessionError> {
        if !self.subroutine {
            return Err(SessionError::NoSubroutine);
        }
        match &mut self.phase {
            HostPhase::Active(active) if active.stage == Stage::Running => match active.exception {
                Pending::Unsent(pending) | Pending::Sent { exception: pending, .. } => {
                    Err(SessionError::ExceptionPending { pending: pending.into() })
                }
                Pending::None if !has_room => Err(SessionError::EventsFull),
                Pending::None => {
                    active.exception = Pending::Unsent(exception);
                    Ok(())
                }
            },
            _ => Err(SessionError::NotRunning),
        }
    }
}

impl Active {
    fn motion(
        &mut self,
        now: Duration,
        phase: MotionPhase,
        error: ErrorCode,
        len: u8,
        config: &HostConfig,
    ) -> HostActions {
        let mut actions = HostActions { missed: self.request.is_some(), ..HostActions::default() };
        self.lost_at = lost(now, config);
        if error == ErrorCode::None {
            self.kept = self.sent;
        } else {
            self.kept =
                if config.keeps(HostRule::WordsUntilRead) { self.kept | self.sent } else { self.sent };
            actions.rejected = Some(error);
        }
        self.sent = self.kept;
        actions.outcome = self.judge_exception(now, phase, error, config);
        self.stage = match (self.stage, phase) {
            (Stage::Stopping { zeros_sent: true }, _)
                if error == ErrorCode::None && (self.kept == 0 || !config.keeps(HostRule::ZerosRead)) =>
            {
                actions.stopped = true;
                return actions;
            }
            (Stage::Stopping { .. }, _) => Stage::Stopping { zeros_sent: !config.keeps(HostRule::ZerosRead) },
            (_, MotionPhase::Running) => Stage::Running,
            (_, MotionPhase::Interrupted) => Stage::Interrupted,
        };
        let end_by = config.end_of_window(now, len.into());
        let shortest = config.reply_len(self.kept.count_ones() as usize);
        self.request = Some(Request {
            due: Due {
                begin_by: end_by.saturating_sub(transmission(shortest, config.baud)).max(now),
                end_by,
            },
            phase,
            follows_until: now.saturating_add(CYCLE * 2).saturating_sub(config.max_delay),
        });
        actions
    }

    /// What the message after a reply says of the exception in it.
    fn judge_exception(
        &mut self,
        now: Duration,
        phase: MotionPhase,
        error: ErrorCode,
        config: &HostConfig,
    ) -> Option<(Exception, ExceptionOutcome)> {
        let Pending::Sent { exception, follows_until } = self.exception else { return None };
        let follows = now < follows_until && config.max_delay < CYCLE / 2;
        let stopping = matches!(self.stage, Stage::Stopping { .. });
        let outcome = match error {
            ErrorCode::None if !config.keeps(HostRule::SendOnce) => {
                self.exception = Pending::Unsent(exception);
                return None;
            }
            ErrorCode::None => ExceptionOutcome::Done,
            _ if phase == MotionPhase::Interrupted => ExceptionOutcome::Unknown(UnknownReason::Unclear),
            ErrorCode::Timeout | ErrorCode::Other(_) if config.keeps(HostRule::RejectedOnly) => {
                ExceptionOutcome::Unknown(UnknownReason::Unclear)
            }
            _ if !follows && config.keeps(HostRule::InSequence) => {
                ExceptionOutcome::Unknown(UnknownReason::OutOfSequence)
            }
            _ if stopping => ExceptionOutcome::NotDone,
            _ => {
                self.exception = Pending::Unsent(exception);
                return None;
            }
        };
        self.exception = Pending::None;
        Some((exception, outcome))
    }

    /// Bytes were corrupt: a message may have been among them.
    fn lose_sequence(&mut self) {
        if let Pending::Sent { follows_until, .. } = &mut self.exception {
            *follows_until = Duration::ZERO;
        }
    }

    fn outcome_at_end(&self) -> Option<(Exception, ExceptionOutcome)> {
        match self.exception {
            Pending::None => None,
            Pending::Unsent(exception) => Some((exception, ExceptionOutcome::NotDone)),
            Pending::Sent { exception, .. } => {
                Some((exception, ExceptionOutcome::Unknown(UnknownReason::Ended)))
            }
        }
    }

    fn course(&self, config: &HostConfig) -> Course {
        let is_offset = config.mode.accumulation() == Accumulation::NonCumulative;
        let stale = config.keeps(HostRule::Stale);
        match (self.stage, self.target) {
            (Stage::Running, Target::Fresh { .. }) => Course::Target,
            (Stage::Running, Target::Stale) if !stale => Course::Target,
            (Stage::Running | Stage::Interrupted, _) if is_offset => Course::Hold,
            (Stage::Accepted | Stage::Running | Stage::Interrupted | Stage::Stopping { .. }, _) => {
                Course::Zero
            }
        }
    }

    /// The words to send, and the axes that must wait; `None`: what must be sent does not fit.
    fn select(&self, now: Duration, draft: Draft, end_by: Duration, config: &HostConfig) -> Option<(u8, u8)> {
        let fits = |select: u8, reserve: Duration| {
            let words = draft.words.iter().enumerate().filter(|(axis, _)| select >> axis & 1 != 0);
            // The select byte is doubled where it selects RY alone.
            let len = usize::from(draft.bare)
                + usize::from(select == DLE)
                + words.map(|(_, len)| usize::from(*len)).sum::<usize>();
            fits(len, reserve, now, end_by, config)
        };
        if fits(ALL, config.reserve) || !config.keeps(HostRule::Late) {
            return Some((ALL, 0));
        }
        let mut select = if config.keeps(HostRule::WordsKept) { self.kept } else { draft.moving };
        if !fits(select, Duration::ZERO) {
            return None;
        }
        for axis in (0..AXES).map(|axis| 1 << axis) {
            if draft.moving & axis != 0 && fits(select | axis, config.reserve) {
                select |= axis;
            }
        }
        Some((select, draft.moving & !select))
    }
}

impl HostInput {
    /// The input's name.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Connected => "connected",
            Self::Disconnected => "disconnected",
            Self::Bytes { .. } => "bytes",
            Self::Start { .. } => "start message",
            Self::Motion { phase: MotionPhase::Running, .. } => "standard message",
            Self::Motion { phase: MotionPhase::Interrupted, .. } => "standard message, interrupted",
            Self::End => "end message",
            Self::CorruptFrame => "corrupt frame",
            Self::Noise => "noise",
            Self::Timeout => "timeout",
            Self::Transmit(_) => "transmit",
            Self::Target => "target",
            Self::NoTarget => "no target",
            Self::Exception { .. } => "exception",
            Self::Stop => "stop",
            Self::Policy(_) => "policy",
            Self::Subroutine(_) => "subroutine",
        }
    }
}

fn fits(len: usize, reserve: Duration, now: Duration, end_by: Duration, config: &HostConfig) -> bool {
    transmission(len, config.baud).saturating_add(reserve) <= end_by.saturating_sub(now)
}

fn answer_start(now: Duration, config: &HostConfig) -> Due {
    let end_by = now.saturating_add(window(config.mode.accumulation()));
    let shortest = transmission(config.reply_len(0).saturating_sub(1), config.baud);
    Due { begin_by: end_by.saturating_sub(shortest).max(now), end_by }
}

fn lost(now: Duration, config: &HostConfig) -> Duration {
    now.saturating_add(CYCLE.saturating_mul(config.silence_cycles))
}
