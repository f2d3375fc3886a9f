//! What happens in an ALTER.

use core::time::Duration;

use super::config::{ExceptionOutcome, HostConfig, HostRule, UnknownReason};
use super::due::Due;
use super::input::{Course, Draft, HostActions};
use super::state::{Active, Pending, Request, Stage, Target};
use crate::framing::DLE;
use crate::message::{ALL, AXES, Accumulation, ErrorCode, Exception, MotionPhase};

impl Active {
    #[inline(always)] // see `HostMachine::on`
    pub(super) fn motion(
        &mut self,
        now: Duration,
        phase: MotionPhase,
        error: ErrorCode,
        len: u8,
        config: &HostConfig,
    ) -> HostActions {
        let mut actions = HostActions { missed: self.request.is_some(), ..HostActions::default() };
        self.lost_at = config.lost_at(now);
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
        self.request = Some(Request {
            due: Due::reply(now, len.into(), self.kept.count_ones(), config),
            phase,
            follows_until: config.follows_until(now),
        });
        actions
    }

    /// What a message says of the exception that was sent. The message after its reply says whether that was read. If not, it
    /// may still be late, and the message after that says whether it has started the subroutine all the same.
    fn judge_exception(
        &mut self,
        now: Duration,
        phase: MotionPhase,
        error: ErrorCode,
        config: &HostConfig,
    ) -> Option<(Exception, ExceptionOutcome)> {
        let (exception, follows_until, is_first) = match self.exception {
            Pending::None | Pending::Unsent(_) => return None,
            Pending::Sent { exception, follows_until } => (exception, follows_until, true),
            Pending::Unread { exception, follows_until } => (exception, follows_until, false),
        };
        let follows = now < follows_until || !config.keeps(HostRule::InSequence);
        let outcome = if !config.is_in_time() && config.keeps(HostRule::InTime) {
            Some(ExceptionOutcome::Unknown(UnknownReason::OutOfSequence))
        } else if is_first && error == ErrorCode::None {
            config.keeps(HostRule::SendOnce).then_some(ExceptionOutcome::Done)
        } else if phase == MotionPhase::Interrupted {
            Some(ExceptionOutcome::Unknown(UnknownReason::Unclear))
        } else if is_first && config.keeps(HostRule::Unread) {
            let follows_until = if follows { config.follows_until(now) } else { Duration::ZERO };
            self.exception = Pending::Unread { exception, follows_until };
            return None;
        } else if !follows {
            Some(ExceptionOutcome::Unknown(UnknownReason::OutOfSequence))
        } else {
            matches!(self.stage, Stage::Stopping { .. }).then_some(ExceptionOutcome::NotDone)
        };
        self.exception = if outcome.is_some() { Pending::None } else { Pending::Unsent(exception) };
        outcome.map(|outcome| (exception, outcome))
    }

    /// Bytes were corrupt: a message may have been among them.
    pub(super) fn lose_sequence(&mut self) {
        if let Pending::Sent { follows_until, .. } | Pending::Unread { follows_until, .. } =
            &mut self.exception
        {
            *follows_until = Duration::ZERO;
        }
    }

    pub(super) fn outcome_at_end(&self) -> Option<(Exception, ExceptionOutcome)> {
        match self.exception {
            Pending::None => None,
            Pending::Unsent(exception) => Some((exception, ExceptionOutcome::NotDone)),
            Pending::Sent { exception, .. } | Pending::Unread { exception, .. } => {
                Some((exception, ExceptionOutcome::Unknown(UnknownReason::Ended)))
            }
        }
    }

    /// The exception that the next reply carries.
    pub(super) fn to_send(&self, config: &HostConfig) -> Exception {
        match self.exception {
            Pending::Unsent(exception)
                if self.stage == Stage::Running || !config.keeps(HostRule::NotInterrupted) =>
            {
                exception
            }
            _ => Exception::None,
        }
    }

    pub(super) fn course(&self, config: &HostConfig) -> Course {
        let is_offset = config.mode.accumulation() == Accumulation::NonCumulative;
        match self.stage {
            Stage::Running => match self.target {
                Target::Fresh { .. } => Course::Target,
                Target::Stale if !config.keeps(HostRule::Stale) => Course::Target,
                Target::Unset | Target::Stale if is_offset => Course::Hold,
                Target::Unset | Target::Stale => Course::Zero,
            },
            Stage::Interrupted => Course::Rest,
            Stage::Accepted | Stage::Stopping { .. } => Course::Zero,
        }
    }

    /// The words to send, and the axes that must wait; `None`: what must be sent does not fit.
    #[inline(always)] // where the lengths are known, so is their sum
    pub(super) fn select(
        &self,
        now: Duration,
        draft: Draft,
        due: Due,
        config: &HostConfig,
    ) -> Option<(u8, u8)> {
        let len = draft.words.iter().fold(usize::from(draft.bare), |len, word| len + usize::from(*word));
        if due.fits(now, len, config.reserve, config) || !config.keeps(HostRule::Late) {
            return Some((ALL, 0));
        }
        self.select_some(now, draft, due, config)
    }

    #[cold]
    fn select_some(&self, now: Duration, draft: Draft, due: Due, config: &HostConfig) -> Option<(u8, u8)> {
        let fits = |select: u8, reserve| {
            let words = draft.words.iter().enumerate().filter(|(axis, _)| select >> axis & 1 != 0);
            // The select byte is doubled where it selects RY alone.
            let len = usize::from(draft.bare)
                + usize::from(select == DLE)
                + words.map(|(_, len)| usize::from(*len)).sum::<usize>();
            due.fits(now, len, reserve, config)
        };
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
