//! The host's machine: everything that decides what the host does, and nothing else. Values of axes are not in it: it knows
//! which words may be other than zero.

use core::time::Duration;

use robot_session::Unexpected;

use super::config::{ExceptionOutcome, HostConfig, HostRule, LostReason, Policy};
use super::due::Due;
use super::input::{Answer, Draft, HostActions, HostInput, Wanted};
use super::state::{Active, HostMachine, HostPhase, Pending, Request, Stage, Target};
use crate::error::SessionError;
use crate::message::{Exception, MotionPhase, StartCode};

type Step = Result<HostActions, Unexpected>;

impl HostMachine {
    /// Takes an input; on an error nothing has changed.
    ///
    /// # Errors
    /// [`Unexpected`]: the port is not open, or there is nothing to transmit.
    #[inline(always)] // where the input is known, little of it is left
    pub fn on(&mut self, now: Duration, input: HostInput, config: &HostConfig) -> Step {
        use {HostInput as On, HostPhase as Is};
        let nothing = HostActions::default();
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
            ) => return Err(self.unexpected(input)),
            (_, On::Bytes { partial }) => {
                self.gap_at = if partial { config.gap.map(|gap| now.saturating_add(gap)) } else { None };
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
            (Is::Silent { lost_at }, On::Motion { .. }) => *lost_at = config.lost_at(now),
            (Is::Active(active), On::Motion { phase, error, len }) => {
                let actions = active.motion(now, phase, error, len, config);
                if actions.stopped && config.keeps(HostRule::Silent) {
                    self.phase = Is::Silent { lost_at: config.lost_at(now) };
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
            ) => return Err(self.unexpected(input)),
        }
        Ok(nothing)
    }

    /// What is to be answered.
    #[inline]
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
                Some(Wanted::Reply { course: active.course(config), exception: active.to_send(config) })
            }
            HostPhase::Disconnected
            | HostPhase::Idle
            | HostPhase::Repeating { answer: None, .. }
            | HostPhase::Silent { .. } => None,
        }
    }

    /// Whether a reply of `len` bytes ends in time that is sent at `now`, with the reserve left: then all words of a [`Draft`]
    /// of that length are sent.
    #[inline]
    pub fn fits(&self, now: Duration, len: usize, config: &HostConfig) -> bool {
        match &self.phase {
            HostPhase::Active(Active { request: Some(request), .. }) => {
                request.due.fits(now, len, config.reserve, config)
            }
            _ => false,
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
        self.phase = HostPhase::Starting { is_expected, answer: Due::start(now, config) };
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
            let forget_at = if config.keeps(HostRule::Forget) { config.lost_at(now) } else { Duration::MAX };
            let answer = Some(Due::start(now, config));
            self.phase = HostPhase::Repeating { asked: asked.saturating_add(1), answer, forget_at };
        }
    }

    fn answer_start(&mut self, now: Duration, draft: Draft, config: &HostConfig) -> HostActions {
        let mut actions = HostActions::default();
        let Some(Wanted::Start(code)) = self.wanted(config) else {
            self.phase = HostPhase::Idle;
            return actions;
        };
        let (HostPhase::Starting { answer: due, .. } | HostPhase::Repeating { answer: Some(due), .. }) =
            &mut self.phase
        else {
            return actions;
        };
        if !due.fits(now, draft.bare.into(), Duration::ZERO, config) && config.keeps(HostRule::Late) {
            due.begin_by = now;
            return actions;
        }
        if let HostPhase::Repeating { answer, .. } = &mut self.phase {
            *answer = None;
        }
        match code {
            // Without room for its outcomes no ALTER begins: the controller asks again.
            StartCode::Accept if !draft.has_room => self.phase = HostPhase::Idle,
            StartCode::Accept => {
                self.phase = HostPhase::Active(Active {
                    stage: Stage::Accepted,
                    request: None,
                    lost_at: config.lost_at(now),
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

    #[inline(always)] // see `on`
    fn reply(&mut self, now: Duration, draft: Draft, config: &HostConfig) -> HostActions {
        let mut actions = HostActions::default();
        let HostPhase::Active(active) = &mut self.phase else { return actions };
        let Some(request) = active.request else { return actions };
        let exception = active.to_send(config);
        let Some((select, held)) = active.select(now, draft, request.due, config) else {
            let due = Due { begin_by: now, ..request.due };
            active.request = Some(Request { due, ..request });
            return actions;
        };
        active.request = None;
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

    #[cold]
    fn unexpected(&self, input: HostInput) -> Unexpected {
        Unexpected { state: self.name(), input: input.name() }
    }

    #[inline(always)] // see `on`
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
                Pending::Unsent(pending)
                | Pending::Sent { exception: pending, .. }
                | Pending::Unread { exception: pending, .. } => {
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
