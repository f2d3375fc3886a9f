//! The controller's machine: all decisions of the controller, and nothing else.

use core::time::Duration;

use robot_session::Unexpected;
use robot_session::end::{Expiry, Machine, is_due};

use super::config::{ControllerConfig, Rule};
pub use super::input::{Action, DueMessage, ExceptionHandling, Input, ReplyEffect, StartOutcome};
pub use super::state::{Alter, ControllerMachine, ControllerPhase, Progress, Turn};
use crate::error::SessionError;
use crate::message::{ErrorCode, Exception, MotionPhase, StartCode};
use crate::timing::{Budget, CYCLE};

impl Machine for ControllerMachine {
    const END: &'static str = "controller";
    const EXPIRY: Expiry = Expiry::BeforeBytes;
    type Input = Input;
    type Action = Action;
    type Transmit = DueMessage;
    type Config = ControllerConfig;

    /// # Errors
    /// The port is not open, or it is not the time.
    fn on(&mut self, now: Duration, input: Input, config: &ControllerConfig) -> Result<Action, Unexpected> {
        use {ControllerPhase as Is, Input as On};
        match (&mut self.phase, input) {
            (phase, On::Connected | On::Disconnected) => {
                let on = matches!(phase, Is::On(_));
                *phase = if matches!(input, On::Connected) { Is::Off } else { Is::Disconnected };
                self.gap_at = None;
                return Ok(if on { Action::End(ErrorCode::Timeout) } else { Action::Nothing });
            }
            (_, On::Timeout) => return Ok(self.expire(now, config)),
            (Is::Disconnected, On::Start { .. }) => return Ok(Action::Refuse(SessionError::NotConnected)),
            (Is::On(_), On::Start { .. }) => return Ok(Action::Refuse(SessionError::AlreadyStarted)),
            (Is::Off, On::Start { has_room: false }) => return Ok(Action::Refuse(SessionError::EventsFull)),
            (Is::Off, On::Start { has_room: true }) => {
                self.phase = Is::On(Alter {
                    progress: Progress::Starting { attempts: 0 },
                    turn: Turn::Controller,
                    error: ErrorCode::None,
                    slot: now,
                    following: now.saturating_add(CYCLE),
                });
                return Ok(Action::Begin);
            }
            (Is::Disconnected | Is::Off, On::Finish | On::Interrupt | On::Return) => {
                return Ok(Action::Refuse(SessionError::NotRunning));
            }
            // Not while a reply is awaited: an exception in it would have no effect, and the host could not know.
            (
                Is::On(Alter { progress: progress @ Progress::Running, turn: Turn::Controller, .. }),
                On::Interrupt,
            ) => {
                *progress = Progress::Interrupted { reported: false, returned: false };
            }
            (Is::On(_), On::Interrupt) => return Ok(Action::Refuse(SessionError::NotRunning)),
            (Is::On(alter), On::Return) => match &mut alter.progress {
                Progress::Interrupted { returned: returned @ false, .. } => {
                    *returned = true;
                    if !config.keeps(Rule::ReportInterruption) {
                        alter.progress = Progress::Running;
                    }
                }
                Progress::Starting { .. }
                | Progress::Running
                | Progress::Interrupted { .. }
                | Progress::Ending => return Ok(Action::Refuse(SessionError::NotRunning)),
            },
            (Is::On(alter), On::Finish) => {
                let starting = matches!(alter.progress, Progress::Starting { .. });
                if alter.progress != Progress::Ending {
                    (alter.progress, alter.error) = (Progress::Ending, ErrorCode::None);
                }
                alter.turn = Turn::Controller;
                if starting {
                    self.phase = Is::Off;
                    return Ok(Action::End(ErrorCode::None));
                }
                return Ok(Action::Rest);
            }
            (
                Is::Disconnected,
                On::Bytes { .. } | On::StartReply(_) | On::Reply { .. } | On::Corrupt(_) | On::Sent { .. },
            ) => return Err(self.unexpected(&input)),
            (_, On::Bytes { partial }) => {
                self.gap_at = config.gap.filter(|_| partial).map(|gap| now.saturating_add(gap));
            }
            (Is::Off, On::StartReply(_) | On::Reply { .. }) => {
                return Ok(Action::Stray);
            }
            (Is::Off, On::Corrupt(_)) => {}
            (Is::On(alter), On::Corrupt(code)) => alter.note(now, code, config),
            (Is::On(alter), On::StartReply(code)) => {
                let action = alter.start_reply(now, code, config);
                return Ok(self.end_start(action));
            }
            (Is::On(alter), On::Reply { exception, has_room }) => {
                return Ok(alter.reply(now, exception, has_room, config));
            }
            (Is::On(_), On::Sent { len }) => {
                let Some(message) = self.transmit(now, config) else { return Err(self.unexpected(&input)) };
                return Ok(self.sent(now, message, len, config));
            }
            (Is::Off, On::Sent { .. }) => return Err(self.unexpected(&input)),
        }
        Ok(Action::Nothing)
    }

    fn transmit(&self, now: Duration, _config: &ControllerConfig) -> Option<DueMessage> {
        match &self.phase {
            ControllerPhase::On(alter) if alter.turn == Turn::Controller && is_due(alter.slot, now) => {
                Some(match alter.progress {
                    Progress::Starting { .. } => DueMessage::Start(alter.error),
                    Progress::Running | Progress::Interrupted { reported: true, returned: true } => {
                        DueMessage::Motion(MotionPhase::Running, alter.error)
                    }
                    Progress::Interrupted { .. } => DueMessage::Motion(MotionPhase::Interrupted, alter.error),
                    Progress::Ending => DueMessage::End(alter.error),
                })
            }
            ControllerPhase::Disconnected | ControllerPhase::Off | ControllerPhase::On(_) => None,
        }
    }

    fn deadline(&self) -> Option<Duration> {
        let turn = match &self.phase {
            ControllerPhase::Disconnected | ControllerPhase::Off => None,
            ControllerPhase::On(alter) => Some(match alter.turn {
                Turn::Controller => alter.slot,
                Turn::Host { closes, .. } => closes,
            }),
        };
        [turn, self.gap_at].into_iter().flatten().min().filter(|at| *at < Duration::MAX)
    }

    fn expires(&self, now: Duration) -> bool {
        self.gap_at.is_some_and(|at| is_due(at, now)) || self.closes(now)
    }

    /// Returns true: bytes that came before the window closes may be the reply.
    fn cuts(&self) -> bool {
        true
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        self.gap_at.iter_mut().for_each(&mut f);
        if let ControllerPhase::On(alter) = &mut self.phase {
            f(&mut alter.slot);
            f(&mut alter.following);
            if let Turn::Host { opens, closes, .. } = &mut alter.turn {
                f(opens);
                f(closes);
            }
        }
    }

    fn name(&self) -> &'static str {
        match &self.phase {
            ControllerPhase::Disconnected => "disconnected",
            ControllerPhase::Off => "off",
            ControllerPhase::On(alter) => match alter.progress {
                Progress::Starting { .. } => "starting",
                Progress::Running => "running",
                Progress::Interrupted { .. } => "interrupted",
                Progress::Ending => "ending",
            },
        }
    }
}

impl ControllerMachine {
    /// Returns whether the window is over.
    fn closes(&self, now: Duration) -> bool {
        matches!(&self.phase, ControllerPhase::On(Alter { turn: Turn::Host { closes, .. }, .. }) if is_due(*closes, now))
    }

    fn expire(&mut self, now: Duration, config: &ControllerConfig) -> Action {
        self.gap_at.take_if(|at| is_due(*at, now));
        let closes = self.closes(now);
        match &mut self.phase {
            ControllerPhase::On(alter) if closes => {
                let action = alter.window_closed(config);
                self.end_start(action)
            }
            ControllerPhase::Disconnected | ControllerPhase::Off | ControllerPhase::On(_) => Action::Nothing,
        }
    }

    fn end_start(&mut self, action: Action) -> Action {
        if let Action::Start(StartOutcome::Refused | StartOutcome::GaveUp)
        | Action::BadStart(_, Some(StartOutcome::GaveUp)) = action
        {
            self.phase = ControllerPhase::Off;
        }
        action
    }

    fn sent(&mut self, now: Duration, message: DueMessage, len: u8, config: &ControllerConfig) -> Action {
        self.gap_at = None;
        let ControllerPhase::On(alter) = &mut self.phase else { return Action::Nothing };
        let budget = Budget::new(config.mode.accumulation(), config.baud, len.into(), 0);
        let opens = now.saturating_add(budget.request);
        let closes = opens.saturating_add(budget.window);
        // On a raster of 28 ms; late once, the next one keeps its window too.
        alter.slot = alter.following.max(closes);
        alter.following = alter.slot.saturating_add(CYCLE);
        alter.turn = Turn::Host { opens, closes, corrupt: None };
        match &mut alter.progress {
            Progress::Starting { attempts } => *attempts = attempts.saturating_add(1),
            Progress::Interrupted { reported: true, returned: true } => alter.progress = Progress::Running,
            Progress::Interrupted { reported, .. } => *reported = true,
            Progress::Running => {}
            Progress::Ending => self.phase = ControllerPhase::Off,
        }
        Action::Sent(message)
    }
}

impl Alter {
    /// Returns whether an answer that has arrived can answer the message that was sent last. An answer that arrives while
    /// that message is still on the line is late, and answers the previous message: messages have no numbers to distinguish
    /// them.
    fn is_awaited(&self, now: Duration, config: &ControllerConfig) -> bool {
        match self.turn {
            Turn::Controller => false,
            Turn::Host { opens, .. } => now >= opens || !config.keeps(Rule::AfterRequest),
        }
    }

    /// Stores the first fault of a window.
    fn note(&mut self, now: Duration, code: ErrorCode, config: &ControllerConfig) {
        let awaited = self.is_awaited(now, config);
        if let Turn::Host { corrupt, .. } = &mut self.turn
            && awaited
        {
            corrupt.get_or_insert(code);
        }
    }

    fn start_reply(&mut self, now: Duration, code: StartCode, config: &ControllerConfig) -> Action {
        if !self.is_awaited(now, config) {
            return Action::Stray;
        }
        if !matches!(self.progress, Progress::Starting { .. }) {
            self.note(now, ErrorCode::Format, config);
            return Action::Nothing;
        }
        self.turn = Turn::Controller;
        match code {
            StartCode::Accept => {
                (self.progress, self.error) = (Progress::Running, ErrorCode::None);
                Action::Start(StartOutcome::Started)
            }
            StartCode::Repeat => {
                self.try_again(ErrorCode::None, config).map_or(Action::Nothing, Action::Start)
            }
            StartCode::Refuse => Action::Start(StartOutcome::Refused),
        }
    }

    fn reply(
        &mut self,
        now: Duration,
        exception: Exception,
        has_room: bool,
        config: &ControllerConfig,
    ) -> Action {
        let awaited = self.is_awaited(now, config);
        if !awaited {
            if config.keeps(Rule::FirstReply) || self.progress != Progress::Running {
                return Action::Stray;
            }
        } else if matches!(self.progress, Progress::Starting { .. } | Progress::Ending) {
            self.note(now, ErrorCode::Format, config);
            return Action::Nothing;
        } else if exception != Exception::None && !has_room {
            self.note(now, ErrorCode::Overflow, config);
            return Action::Nothing;
        }
        if awaited {
            (self.turn, self.error) = (Turn::Controller, ErrorCode::None);
        }
        let running = self.progress == Progress::Running;
        let moves = running || !config.keeps(Rule::RestInterrupted);
        let taken = if moves && config.mode.uses_inputs() { ReplyEffect::Moves } else { ReplyEffect::Rests };
        // The subroutine runs already; a second exception does not start it again.
        if exception == Exception::None || !running && config.keeps(Rule::OneSubroutine) {
            return Action::Take(taken, None);
        }
        let handling = if config.subroutine {
            self.progress = Progress::Interrupted { reported: false, returned: false };
            ExceptionHandling::Subroutine(exception)
        } else {
            self.progress = Progress::Ending;
            ExceptionHandling::Abort(exception)
        };
        Action::Take(taken, Some(handling))
    }

    /// Handles the end of the window without a good reply.
    fn window_closed(&mut self, config: &ControllerConfig) -> Action {
        let Turn::Host { corrupt, .. } = self.turn else { return Action::Nothing };
        let code = corrupt.unwrap_or(ErrorCode::Timeout);
        (self.turn, self.error) = (Turn::Controller, code);
        match self.progress {
            Progress::Starting { .. } => Action::BadStart(code, self.try_again(code, config)),
            // "da die Robotersteuerung bei Ausbleiben von Antwortpaketen den ALTER-Betrieb beendet" (§3.3.3)
            Progress::Running | Progress::Interrupted { .. }
                if code == ErrorCode::Timeout && config.keeps(Rule::EndOnMissing) =>
            {
                self.progress = Progress::Ending;
                Action::Missing
            }
            Progress::Running | Progress::Interrupted { .. } | Progress::Ending => Action::BadReply(code),
        }
    }

    fn try_again(&mut self, code: ErrorCode, config: &ControllerConfig) -> Option<StartOutcome> {
        self.error = code;
        let Progress::Starting { attempts } = self.progress else { return None };
        let enough = attempts >= config.attempts || !config.keeps(Rule::Attempts);
        enough.then_some(StartOutcome::GaveUp)
    }
}
