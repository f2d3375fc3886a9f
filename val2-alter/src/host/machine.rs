//! The host's machine: all decisions of the host, and nothing else. It does not contain the values of axes, only which words
//! may be other than zero.

use core::time::Duration;

use robot_session::Unexpected;
use robot_session::end::{Expiry, Machine, is_due};

use super::config::{ExceptionOutcome, HostConfig, LostReason, Policy, Rule};
pub use super::deadline::ReplyDeadline;
pub use super::input::{Action, Answer, Draft, Input, Outcome, OutputMode, PreviousReply};
pub use super::state::{ActiveAlter, HostMachine, HostPhase, PendingException, Request, Stage, Target};
use crate::error::SessionError;
use crate::message::{Exception, StartCode};

impl Machine for HostMachine {
    const END: &'static str = "host";
    const EXPIRY: Expiry = Expiry::BeforeInput;
    type Input = Input;
    type Action = Action;
    type Transmit = Answer;
    type Config = HostConfig;

    /// # Errors
    /// The port is not open, or nothing is to be answered.
    #[inline(always)] // where the input is known, little of it is left
    fn on(&mut self, now: Duration, input: Input, config: &HostConfig) -> Result<Action, Unexpected> {
        use {HostPhase as Is, Input as On};
        match input {
            On::Connected | On::Disconnected => {
                let action = self.over(LostReason::Disconnected, false);
                self.phase = if input == On::Connected { Is::Idle } else { Is::Disconnected };
                self.gap_at = None;
                return Ok(action);
            }
            On::Timeout => return Ok(self.expire(now)),
            On::Stop => return Ok(self.stop(config)),
            On::Exception { exception, has_room } => {
                return Ok(match self.take_exception(exception, has_room) {
                    Ok(()) => Action::Nothing,
                    Err(error) => Action::Refuse(error),
                });
            }
            On::Policy(policy) => self.policy = policy,
            On::Subroutine(installed) => self.subroutine = installed,
            On::Target => {
                if let Is::Active(active) = &mut self.phase {
                    active.target = Target::Fresh { until: now.saturating_add(config.target_timeout) };
                }
            }
            On::NoTarget => {
                if let Is::Active(active) = &mut self.phase {
                    active.target = Target::Stale;
                }
            }
            _ if self.phase == Is::Disconnected => return Err(self.unexpected(&input)),
            On::Bytes { partial } => {
                self.gap_at = if partial { config.gap.map(|gap| now.saturating_add(gap)) } else { None };
            }
            On::Start { is_expected } => return Ok(self.start(now, is_expected, config)),
            On::End => {
                let action = match self.over(LostReason::Silence, false) {
                    Action::Lost { outcome, .. } => Action::Ended(outcome),
                    other => other,
                };
                self.phase = Is::Idle;
                return Ok(action);
            }
            On::Motion { phase, error, len } => match &mut self.phase {
                Is::Active(active) => {
                    let action = active.motion(now, phase, error, len, config);
                    if matches!(action, Action::Stopped(_)) && config.keeps(Rule::Silent) {
                        self.phase = Is::Silent { lost_at: config.lost_at(now) };
                    }
                    return Ok(action);
                }
                Is::Silent { lost_at } => *lost_at = config.lost_at(now),
                // A message of an ALTER whose start was not received is not answered: its mode is not known.
                Is::Disconnected | Is::Idle | Is::Repeating { .. } | Is::Starting { .. } => {}
            },
            On::CorruptFrame => match &mut self.phase {
                Is::Active(active) => active.lose_sequence(),
                Is::Idle => self.ask_again(now, 0, config),
                Is::Repeating { asked, answer: None, .. } => {
                    let asked = *asked;
                    self.ask_again(now, asked, config);
                }
                Is::Disconnected | Is::Repeating { .. } | Is::Starting { .. } | Is::Silent { .. } => {}
            },
            On::Noise => {
                if let Is::Active(active) = &mut self.phase {
                    active.lose_sequence();
                }
            }
            On::Sent { moving, at_rest } => match &mut self.phase {
                Is::Active(active) if active.request.is_some() => {
                    return Ok(active.replied(moving, at_rest, config));
                }
                _ => return self.answered_start(now, &input, config),
            },
            On::Late => match &mut self.phase {
                Is::Starting { answer, .. } | Is::Repeating { answer: Some(answer), .. } => {
                    answer.begin_by = now;
                }
                Is::Active(ActiveAlter { request: Some(request), .. }) => request.due.begin_by = now,
                _ => return Err(self.unexpected(&input)),
            },
            On::Ignored => match &self.phase {
                Is::Starting { .. } | Is::Repeating { answer: Some(_), .. } => self.phase = Is::Idle,
                _ => return Err(self.unexpected(&input)),
            },
        }
        Ok(Action::Nothing)
    }

    #[inline]
    fn transmit(&self, now: Duration, config: &HostConfig) -> Option<Answer> {
        match &self.phase {
            HostPhase::Starting { is_expected, .. } => match self.policy {
                Policy::Accept if *is_expected => Some(Answer::Start(StartCode::Accept)),
                Policy::Accept | Policy::Refuse => Some(Answer::Start(StartCode::Refuse)),
                Policy::Ignore => Some(Answer::Nothing),
            },
            HostPhase::Repeating { asked, answer: Some(_), .. } => match self.policy {
                Policy::Accept if *asked <= config.repeats => Some(Answer::Start(StartCode::Repeat)),
                Policy::Accept | Policy::Refuse => Some(Answer::Start(StartCode::Refuse)),
                Policy::Ignore => Some(Answer::Nothing),
            },
            HostPhase::Active(active) => {
                active.request?;
                Some(Answer::Reply { course: active.course(now, config), exception: active.to_send(config) })
            }
            HostPhase::Disconnected
            | HostPhase::Idle
            | HostPhase::Repeating { answer: None, .. }
            | HostPhase::Silent { .. } => None,
        }
    }

    #[inline]
    fn deadline(&self) -> Option<Duration> {
        Some(self.expires_at()).filter(|at| *at < Duration::MAX)
    }

    #[inline(always)]
    fn expires(&self, now: Duration) -> bool {
        is_due(self.expires_at(), now)
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        self.gap_at.iter_mut().for_each(&mut f);
        let mut due = |due: &mut ReplyDeadline| {
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
                }
                if let Target::Fresh { until } = &mut active.target {
                    f(until);
                }
                active.settles_at.iter_mut().for_each(&mut f);
                f(&mut active.lost_at);
            }
        }
    }

    fn name(&self) -> &'static str {
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
}

impl HostMachine {
    /// Returns the next time at which [`Input::Timeout`] has something to do.
    #[inline(always)]
    fn expires_at(&self) -> Duration {
        const NEVER: Duration = Duration::MAX;
        let at = match &self.phase {
            HostPhase::Disconnected | HostPhase::Idle => NEVER,
            HostPhase::Repeating { answer, forget_at, .. } => {
                answer.map_or(*forget_at, |due| due.begin_by.min(*forget_at))
            }
            HostPhase::Starting { answer, .. } => answer.begin_by,
            HostPhase::Active(ActiveAlter { lost_at, target, request, .. }) => {
                let target = if let Target::Fresh { until } = target { *until } else { NEVER };
                request.map_or(NEVER, |request| request.due.begin_by).min(target).min(*lost_at)
            }
            HostPhase::Silent { lost_at } => *lost_at,
        };
        self.gap_at.map_or(at, |gap| gap.min(at))
    }

    /// Returns whether a reply of `len` bytes that is sent at `now` ends in time, with the reserve left: then all words of a
    /// [`Draft`] of that length are sent.
    #[inline]
    pub fn fits(&self, now: Duration, len: usize, config: &HostConfig) -> bool {
        match &self.phase {
            HostPhase::Active(ActiveAlter { request: Some(request), .. }) => {
                request.due.fits(now, len, config.reserve, config)
            }
            _ => false,
        }
    }

    /// Returns the words of an answer to send, and the axes that must stay at zero because their words do not fit; `None` if
    /// the words that must be sent do not fit.
    #[inline]
    pub fn select(&self, now: Duration, draft: &Draft, config: &HostConfig) -> Option<(u8, u8)> {
        match &self.phase {
            HostPhase::Active(active) => active.select(now, draft, active.request?.due, config),
            HostPhase::Starting { answer, .. } | HostPhase::Repeating { answer: Some(answer), .. } => {
                let fits = answer.fits(now, draft.bare.into(), Duration::ZERO, config);
                (fits || !config.keeps(Rule::Late)).then_some((0, 0))
            }
            HostPhase::Disconnected
            | HostPhase::Idle
            | HostPhase::Repeating { answer: None, .. }
            | HostPhase::Silent { .. } => None,
        }
    }

    fn start(&mut self, now: Duration, is_expected: bool, config: &HostConfig) -> Action {
        let missed = self.reply_by().is_some();
        // A repeated start message: the answer to the previous one was not read.
        let again = matches!(&self.phase, HostPhase::Active(active) if active.stage == Stage::Accepted);
        let action = match self.over(LostReason::Restart, missed) {
            lost @ Action::Lost { .. } if config.keeps(Rule::Restart) && !again => lost,
            _ if missed => Action::Missed,
            _ => Action::Nothing,
        };
        let is_expected = is_expected || !config.keeps(Rule::Mode);
        self.phase = HostPhase::Starting { is_expected, answer: ReplyDeadline::start(now, config) };
        action
    }

    /// Returns the action at the end of ALTER, if there is one, with the outcome of the caller's exception.
    fn over(&self, reason: LostReason, missed: bool) -> Action {
        let outcome = match &self.phase {
            HostPhase::Active(active) => active.outcome_at_end(),
            HostPhase::Silent { .. } => None,
            HostPhase::Disconnected
            | HostPhase::Idle
            | HostPhase::Repeating { .. }
            | HostPhase::Starting { .. } => return Action::Nothing,
        };
        Action::Lost { missed, outcome, reason }
    }

    /// Requests a message again: "Der externe Rechner hat einen Kommunikationsfehler entdeckt und erwartet, daß die
    /// Robotersteuerung die einleitende Nachricht wiederholt" (§3.3.1). A corrupt standard message has no such answer: the
    /// controller's timeout is its answer.
    fn ask_again(&mut self, now: Duration, asked: u8, config: &HostConfig) {
        if self.policy == Policy::Accept {
            let forget_at = if config.keeps(Rule::Forget) { config.lost_at(now) } else { Duration::MAX };
            let answer = Some(ReplyDeadline::start(now, config));
            self.phase = HostPhase::Repeating { asked: asked.saturating_add(1), answer, forget_at };
        }
    }

    fn answered_start(
        &mut self,
        now: Duration,
        input: &Input,
        config: &HostConfig,
    ) -> Result<Action, Unexpected> {
        let Some(Answer::Start(code)) = self.transmit(now, config) else {
            return Err(self.unexpected(input));
        };
        if let HostPhase::Repeating { answer, .. } = &mut self.phase {
            *answer = None;
        }
        match code {
            StartCode::Accept => {
                let is_late = !config.is_in_time() && config.keeps(Rule::WordsLate);
                self.phase = HostPhase::Active(ActiveAlter {
                    stage: Stage::Accepted,
                    request: None,
                    lost_at: config.lost_from(now),
                    target: Target::Unset,
                    exception: PendingException::None,
                    kept: 0,
                    sent: 0,
                    settles_at: is_late.then(|| config.settles_at(now)),
                    in_sequence: false,
                });
            }
            StartCode::Repeat => {}
            StartCode::Refuse => self.phase = HostPhase::Idle,
        }
        Ok(Action::SentStart(code))
    }

    /// Handles expired deadlines, one at a time.
    #[cold]
    fn expire(&mut self, now: Duration) -> Action {
        if self.gap_at.take_if(|at| is_due(*at, now)).is_some() {
            return Action::EndFrame;
        }
        match &mut self.phase {
            HostPhase::Disconnected | HostPhase::Idle => {}
            HostPhase::Repeating { answer, forget_at, .. } => {
                if answer.take_if(|due| is_due(due.begin_by, now)).is_some() {
                    return Action::Missed;
                }
                if is_due(*forget_at, now) {
                    self.phase = HostPhase::Idle;
                }
            }
            HostPhase::Starting { answer, .. } if is_due(answer.begin_by, now) => {
                self.phase = HostPhase::Idle;
                return Action::Missed;
            }
            HostPhase::Starting { .. } => {}
            HostPhase::Active(active) => {
                if active.request.take_if(|request| is_due(request.due.begin_by, now)).is_some() {
                    return Action::Missed;
                }
                if matches!(&active.target, Target::Fresh { until } if is_due(*until, now)) {
                    active.target = Target::Stale;
                    return Action::Stale;
                }
                if is_due(active.lost_at, now) {
                    return self.lose();
                }
            }
            HostPhase::Silent { lost_at } if is_due(*lost_at, now) => return self.lose(),
            HostPhase::Silent { .. } => {}
        }
        Action::Nothing
    }

    fn lose(&mut self) -> Action {
        let action = self.over(LostReason::Silence, false);
        self.phase = HostPhase::Idle;
        action
    }

    fn stop(&mut self, config: &HostConfig) -> Action {
        self.policy = Policy::Ignore;
        match &mut self.phase {
            HostPhase::Active(active) if active.stage == Stage::Accepted => {
                self.phase = HostPhase::Silent { lost_at: active.lost_at };
                return Action::Stopped(PreviousReply::default());
            }
            HostPhase::Active(active) => {
                if !matches!(active.stage, Stage::Stopping { .. }) {
                    active.stage = Stage::Stopping { zeros_sent: !config.keeps(Rule::ZerosRead) };
                }
                if let PendingException::Unsent(exception) = active.exception {
                    active.exception = PendingException::None;
                    return Action::Exception(exception, ExceptionOutcome::NotDone);
                }
            }
            HostPhase::Repeating { .. } | HostPhase::Starting { .. } => self.phase = HostPhase::Idle,
            HostPhase::Disconnected | HostPhase::Idle | HostPhase::Silent { .. } => {}
        }
        Action::Nothing
    }

    fn take_exception(&mut self, exception: Exception, has_room: bool) -> Result<(), SessionError> {
        if !self.subroutine {
            return Err(SessionError::NoSubroutine);
        }
        match &mut self.phase {
            HostPhase::Active(active) if active.stage == Stage::Running => match active.exception {
                PendingException::Unsent(pending)
                | PendingException::Sent(pending)
                | PendingException::Unread { exception: pending, .. } => {
                    Err(SessionError::ExceptionPending { pending: pending.into() })
                }
                PendingException::None if !has_room => Err(SessionError::EventsFull),
                PendingException::None => {
                    active.exception = PendingException::Unsent(exception);
                    Ok(())
                }
            },
            _ => Err(SessionError::NotRunning),
        }
    }
}
