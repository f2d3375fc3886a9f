//! The part of the host's machine for an active ALTER.

use core::time::Duration;

use robot_session::end::is_due;

use super::config::{ExceptionOutcome, HostConfig, Rule, UnknownReason};
use super::deadline::ReplyDeadline;
use super::input::{Action, Draft, Outcome, OutputMode, PreviousReply};
use super::state::{ActiveAlter, PendingException, Request, Stage, Target};
use crate::framing::DLE;
use crate::message::{ALL, AXES, Accumulation, ErrorCode, Exception, MotionPhase};
use crate::timing::{CYCLE_NANOS, after};

impl ActiveAlter {
    #[inline(always)] // see `HostMachine::on`
    pub(super) fn motion(
        &mut self,
        now: Duration,
        phase: MotionPhase,
        error: ErrorCode,
        len: usize,
        config: &HostConfig,
    ) -> Action {
        let missed = self.request.is_some();
        let lost_at = config.lost_from(now);
        let delayed = lost_at < after(self.lost_at, CYCLE_NANOS) && self.was_delayed(lost_at, config);
        let rejected = (error != ErrorCode::None).then(|| (error, self.follows(lost_at, config)));
        let outcome = self.judge_exception(lost_at, phase, error, config);
        (self.lost_at, self.in_sequence) = (lost_at, false);
        if self.settles_at.is_some() {
            self.keep_late(now, phase, error, config);
        } else {
            let uncertain = error != ErrorCode::None && config.keeps(Rule::WordsUntilRead);
            self.kept = if uncertain { self.kept | self.sent } else { self.sent };
            self.sent = self.kept;
        }
        let previous = PreviousReply { missed, delayed, rejected, outcome };
        self.stage = match (self.stage, phase) {
            (Stage::Stopping { zeros_sent: true }, _)
                if error == ErrorCode::None && (self.kept == 0 || !config.keeps(Rule::ZerosRead)) =>
            {
                return Action::Stopped(previous);
            }
            (Stage::Stopping { .. }, _) => Stage::Stopping { zeros_sent: !config.keeps(Rule::ZerosRead) },
            (_, MotionPhase::Running) => Stage::Running,
            (_, MotionPhase::Interrupted) => Stage::Interrupted,
        };
        self.request =
            Some(Request { due: ReplyDeadline::reply(now, len, self.kept.count_ones(), config), phase });
        Action::Asked(previous)
    }

    /// Returns whether the previous message was late: a controller sends one in a cycle. `lost_at` implies the time
    /// of its arrival.
    #[cold]
    fn was_delayed(&self, lost_at: Duration, config: &HostConfig) -> bool {
        self.stage != Stage::Accepted
            && lost_at.saturating_add(config.max_delay) < after(self.lost_at, CYCLE_NANOS)
    }

    /// Updates `kept` if replies may be late: a message does not show which reply was read, so an axis leaves `kept` when
    /// all replies that can have come in its window had a zero for it.
    #[cold]
    fn keep_late(&mut self, now: Duration, phase: MotionPhase, error: ErrorCode, config: &HostConfig) {
        self.kept |= self.sent;
        let is_interrupted = phase == MotionPhase::Interrupted || self.stage == Stage::Interrupted;
        if is_interrupted && config.keeps(Rule::WordsInterrupted) {
            self.sent = self.kept;
        } else if error == ErrorCode::None && self.settles_at.is_some_and(|at| is_due(at, now)) {
            (self.kept, self.sent) = (self.sent, 0);
            self.settles_at = Some(config.settles_at(now));
        }
    }

    /// Returns whether an error code is about the last reply. After a message that was not answered, it is about the reply
    /// to that message; if replies may be late, it may be about any reply.
    #[cold]
    fn follows(&self, lost_at: Duration, config: &HostConfig) -> bool {
        config.is_in_time() && self.in_sequence && self.is_next(lost_at, config)
            || !config.keeps(Rule::Rejected)
    }

    /// Returns whether no message was lost since the previous one, from the times of arrival that `lost_at` implies.
    fn is_next(&self, lost_at: Duration, config: &HostConfig) -> bool {
        lost_at.saturating_add(config.max_delay) < after(self.lost_at, 2 * CYCLE_NANOS)
    }

    /// Returns the outcome of the exception that was sent, if a message shows it. The message after the reply with
    /// the exception reports whether the reply was read. If not, the reply may still be late, and the message after
    /// that reports whether it has started the subroutine nevertheless.
    fn judge_exception(
        &mut self,
        lost_at: Duration,
        phase: MotionPhase,
        error: ErrorCode,
        config: &HostConfig,
    ) -> Outcome {
        let (exception, in_sequence, is_first) = match self.exception {
            PendingException::None | PendingException::Unsent(_) => return None,
            PendingException::Sent(exception) => (exception, self.in_sequence, true),
            PendingException::Unread { exception, in_sequence } => (exception, in_sequence, false),
        };
        let follows = in_sequence && self.is_next(lost_at, config) || !config.keeps(Rule::InSequence);
        let outcome = if !config.is_in_time() && config.keeps(Rule::InTime) {
            Some(ExceptionOutcome::Unknown(UnknownReason::OutOfSequence))
        } else if is_first && error == ErrorCode::None {
            config.keeps(Rule::SendOnce).then_some(ExceptionOutcome::Done)
        } else if phase == MotionPhase::Interrupted {
            Some(ExceptionOutcome::Unknown(UnknownReason::Unclear))
        } else if is_first && config.keeps(Rule::Unread) {
            self.exception = PendingException::Unread { exception, in_sequence: follows };
            return None;
        } else if !follows {
            Some(ExceptionOutcome::Unknown(UnknownReason::OutOfSequence))
        } else {
            matches!(self.stage, Stage::Stopping { .. }).then_some(ExceptionOutcome::NotDone)
        };
        self.exception =
            if outcome.is_some() { PendingException::None } else { PendingException::Unsent(exception) };
        outcome.map(|outcome| (exception, outcome))
    }

    /// Called when a reply was sent.
    #[inline(always)] // see `HostMachine::on`
    pub(super) fn replied(&mut self, moving: u8, at_rest: bool, config: &HostConfig) -> Action {
        let exception = self.to_send(config);
        let Some(request) = self.request.take() else { return Action::Nothing };
        self.sent = if self.settles_at.is_some() { self.sent | moving } else { moving };
        // It is unknown whether a controller keeps the words that come while its subroutine runs. An exception that was not
        // read may come late and have started it since the message.
        let is_interrupted =
            request.phase == MotionPhase::Interrupted && config.keeps(Rule::WordsInterrupted);
        let is_unread =
            matches!(self.exception, PendingException::Unread { .. }) && config.keeps(Rule::WordsUnread);
        if is_interrupted || is_unread {
            self.kept |= self.sent;
            self.sent = self.kept;
        }
        self.in_sequence = true;
        if exception != Exception::None {
            self.exception = PendingException::Sent(exception);
        }
        if let Stage::Stopping { zeros_sent } = &mut self.stage {
            *zeros_sent = at_rest;
        }
        Action::SentReply(exception)
    }

    /// Called when bytes were corrupt: a message may have been among them.
    pub(super) fn lose_sequence(&mut self) {
        self.in_sequence = false;
        if self.settles_at.is_some() {
            // One of them may have been the message that ALTER is interrupted.
            self.sent |= self.kept;
        }
        if let PendingException::Unread { in_sequence, .. } = &mut self.exception {
            *in_sequence = false;
        }
    }

    pub(super) fn outcome_at_end(&self) -> Outcome {
        match self.exception {
            PendingException::None => None,
            PendingException::Unsent(exception) => Some((exception, ExceptionOutcome::NotDone)),
            PendingException::Sent(exception) | PendingException::Unread { exception, .. } => {
                Some((exception, ExceptionOutcome::Unknown(UnknownReason::Ended)))
            }
        }
    }

    /// Returns the exception of the next reply.
    pub(super) fn to_send(&self, config: &HostConfig) -> Exception {
        match self.exception {
            PendingException::Unsent(exception)
                if self.stage == Stage::Running || !config.keeps(Rule::NotInterrupted) =>
            {
                exception
            }
            _ => Exception::None,
        }
    }

    /// Returns the goal of the values. A target that is too old is not followed, even if a caller has not passed the time
    /// before it polls for bytes.
    pub(super) fn course(&self, now: Duration, config: &HostConfig) -> OutputMode {
        let is_offset = config.mode.accumulation() == Accumulation::NonCumulative;
        match self.stage {
            Stage::Running => match self.target {
                Target::Fresh { until } if !is_due(until, now) || !config.keeps(Rule::FreshInUse) => {
                    OutputMode::Target
                }
                Target::Stale if !config.keeps(Rule::Stale) => OutputMode::Target,
                Target::Unset | Target::Fresh { .. } | Target::Stale if is_offset => OutputMode::Hold,
                Target::Unset | Target::Fresh { .. } | Target::Stale => OutputMode::Zero,
            },
            Stage::Interrupted => OutputMode::Rest,
            Stage::Accepted | Stage::Stopping { .. } => OutputMode::Zero,
        }
    }

    /// Returns the words to send, and the axes that must wait; `None`: the words that must be sent do not fit.
    #[inline(always)] // where the lengths are known, so is their sum
    pub(super) fn select(
        &self,
        now: Duration,
        draft: &Draft,
        due: ReplyDeadline,
        config: &HostConfig,
    ) -> Option<(u8, u8)> {
        let len = draft.words.iter().fold(usize::from(draft.bare), |len, word| len + usize::from(*word));
        if due.fits(now, len, config.reserve, config) || !config.keeps(Rule::Late) {
            return Some((ALL, 0));
        }
        self.select_some(now, draft, due, config)
    }

    #[cold]
    fn select_some(
        &self,
        now: Duration,
        draft: &Draft,
        due: ReplyDeadline,
        config: &HostConfig,
    ) -> Option<(u8, u8)> {
        let fits = |select: u8, reserve| {
            let words = draft.words.iter().enumerate().filter(|(axis, _)| select >> axis & 1 != 0);
            // The select byte is doubled if it selects RY alone.
            let len = usize::from(draft.bare)
                + usize::from(select == DLE)
                + words.map(|(_, len)| usize::from(*len)).sum::<usize>();
            due.fits(now, len, reserve, config)
        };
        let mut select = if config.keeps(Rule::WordsKept) { self.kept } else { draft.moving };
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
