//! The controller's machine: everything that decides what the controller does, and nothing else.

use core::time::Duration;

use robot_session::Unexpected;

use super::config::{ControllerConfig, ControllerRule};
use super::input::{ControllerActions, ControllerInput, Handling, Outgoing, StartOutcome, Taken};
use super::state::{Alter, ControllerMachine, ControllerPhase, Progress, Turn};
use crate::error::SessionError;
use crate::message::{ErrorCode, Exception, MotionPhase, StartCode};
use crate::timing::{Budget, CYCLE};

type Step = Result<ControllerActions, Unexpected>;

impl ControllerMachine {
    /// Takes an input; on an error nothing has changed.
    ///
    /// # Errors
    /// [`Unexpected`]: the port is not open, or it is not the time.
    pub fn on(&mut self, now: Duration, input: ControllerInput, config: &ControllerConfig) -> Step {
        use {ControllerInput as On, ControllerPhase as Is};
        let nothing = ControllerActions::default();
        match (&mut self.phase, input) {
            (phase, On::Connected | On::Disconnected) => {
                let on = matches!(phase, Is::On(_));
                *phase = if input == On::Connected { Is::Off } else { Is::Disconnected };
                self.gap_at = None;
                let ended = on.then_some(ErrorCode::Timeout);
                return Ok(ControllerActions { ended, rest: on, ..nothing });
            }
            (_, On::Timeout) => return Ok(self.pass_time(now)),
            (Is::Disconnected, On::Start { .. }) => return Ok(refused(SessionError::NotConnected)),
            (Is::On(_), On::Start { .. }) => return Ok(refused(SessionError::AlreadyStarted)),
            (Is::Off, On::Start { has_room: false }) => return Ok(refused(SessionError::EventsFull)),
            (Is::Off, On::Start { has_room: true }) => {
                self.phase = Is::On(Alter {
                    progress: Progress::Starting { attempts: 0 },
                    turn: Turn::Controller,
                    error: ErrorCode::None,
                    slot: now,
                    following: now.saturating_add(CYCLE),
                });
                return Ok(ControllerActions { restart: true, ..nothing });
            }
            (Is::Disconnected | Is::Off, On::Finish | On::Interrupt | On::Return) => {
                return Ok(refused(SessionError::NotRunning));
            }
            // Not while a reply is awaited: an exception in it would have no effect, and the host could not know.
            (
                Is::On(Alter { progress: progress @ Progress::Running, turn: Turn::Controller, .. }),
                On::Interrupt,
            ) => {
                *progress = Progress::Interrupted { reported: false, returned: false };
            }
            (Is::On(_), On::Interrupt) => return Ok(refused(SessionError::NotRunning)),
            (Is::On(alter), On::Return) => match &mut alter.progress {
                Progress::Interrupted { returned: returned @ false, .. } => {
                    *returned = true;
                    if !config.keeps(ControllerRule::ReportInterruption) {
                        alter.progress = Progress::Running;
                    }
                }
                Progress::Starting { .. }
                | Progress::Running
                | Progress::Interrupted { .. }
                | Progress::Ending => return Ok(refused(SessionError::NotRunning)),
            },
            (Is::On(alter), On::Finish) => {
                let starting = matches!(alter.progress, Progress::Starting { .. });
                if alter.progress != Progress::Ending {
                    (alter.progress, alter.error) = (Progress::Ending, ErrorCode::None);
                }
                alter.turn = Turn::Controller;
                if starting {
                    self.phase = Is::Off;
                }
                let ended = starting.then_some(ErrorCode::None);
                return Ok(ControllerActions { rest: true, ended, ..nothing });
            }
            (
                Is::Disconnected,
                On::Bytes { .. }
                | On::StartReply(_)
                | On::Reply { .. }
                | On::Corrupt(_)
                | On::Transmit { .. },
            ) => return Err(self.unexpected(input)),
            (_, On::Bytes { partial }) => {
                self.gap_at = config.gap.filter(|_| partial).map(|gap| now.saturating_add(gap));
            }
            (Is::Off, On::StartReply(_) | On::Reply { .. }) => {
                return Ok(ControllerActions { stray: true, ..nothing });
            }
            (Is::Off, On::Corrupt(_)) => {}
            (Is::On(alter), On::Corrupt(code)) => alter.note(now, code, config),
            (Is::On(alter), On::StartReply(code)) => {
                let actions = alter.start_reply(now, code, config);
                return Ok(self.end_start(actions));
            }
            (Is::On(alter), On::Reply { exception, has_room }) => {
                return Ok(alter.reply(now, exception, has_room, config));
            }
            (Is::On(Alter { turn: Turn::Host { closes, .. }, .. }), On::WindowClosed) if *closes > now => {
                return Err(self.unexpected(input));
            }
            (Is::On(alter), On::WindowClosed) => {
                let actions = alter.window_closed(config);
                return Ok(self.end_start(actions));
            }
            (Is::Disconnected | Is::Off, On::WindowClosed) => {}
            (Is::On(_), On::Transmit { len }) => {
                let Some(message) = self.due(now) else { return Err(self.unexpected(input)) };
                return Ok(self.transmit(now, message, len, config));
            }
            (Is::Off, On::Transmit { .. }) => return Err(self.unexpected(input)),
        }
        Ok(nothing)
    }

    /// The message that is due.
    pub fn due(&self, now: Duration) -> Option<Outgoing> {
        match &self.phase {
            ControllerPhase::On(alter) if alter.turn == Turn::Controller && now >= alter.slot => {
                Some(match alter.progress {
                    Progress::Starting { .. } => Outgoing::Start(alter.error),
                    Progress::Running | Progress::Interrupted { reported: true, returned: true } => {
                        Outgoing::Motion(MotionPhase::Running, alter.error)
                    }
                    Progress::Interrupted { .. } => Outgoing::Motion(MotionPhase::Interrupted, alter.error),
                    Progress::Ending => Outgoing::End(alter.error),
                })
            }
            ControllerPhase::Disconnected | ControllerPhase::Off | ControllerPhase::On(_) => None,
        }
    }

    fn unexpected(&self, input: ControllerInput) -> Unexpected {
        Unexpected { state: self.name(), input: input.name() }
    }

    fn pass_time(&mut self, now: Duration) -> ControllerActions {
        let end_frame = self.gap_at.take_if(|at| *at <= now).is_some();
        let close_window = match &self.phase {
            ControllerPhase::On(Alter { turn: Turn::Host { closes, .. }, .. }) => *closes <= now,
            ControllerPhase::Disconnected | ControllerPhase::Off | ControllerPhase::On(_) => false,
        };
        ControllerActions { end_frame, close_window, ..ControllerActions::default() }
    }

    fn end_start(&mut self, actions: ControllerActions) -> ControllerActions {
        if let Some(StartOutcome::Refused | StartOutcome::GaveUp) = actions.start {
            self.phase = ControllerPhase::Off;
        }
        actions
    }

    fn transmit(
        &mut self,
        now: Duration,
        message: Outgoing,
        len: u8,
        config: &ControllerConfig,
    ) -> ControllerActions {
        let mut actions = ControllerActions { send: Some(message), ..ControllerActions::default() };
        self.gap_at = None;
        let ControllerPhase::On(alter) = &mut self.phase else { return actions };
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
            Progress::Ending => {
                actions.ended = Some(alter.error);
                self.phase = ControllerPhase::Off;
            }
        }
        actions
    }
}

impl Alter {
    /// Whether an answer that has arrived can be one to the message that was sent last. One that arrives while that is still on
    /// the line is late, and an answer to the message before: there are no numbers to see it by.
    fn is_awaited(&self, now: Duration, config: &ControllerConfig) -> bool {
        match self.turn {
            Turn::Controller => false,
            Turn::Host { opens, .. } => now >= opens || !config.keeps(ControllerRule::AfterRequest),
        }
    }

    /// The first fault of a window counts.
    fn note(&mut self, now: Duration, code: ErrorCode, config: &ControllerConfig) {
        let awaited = self.is_awaited(now, config);
        if let Turn::Host { corrupt, .. } = &mut self.turn
            && awaited
        {
            corrupt.get_or_insert(code);
        }
    }

    fn start_reply(
        &mut self,
        now: Duration,
        code: StartCode,
        config: &ControllerConfig,
    ) -> ControllerActions {
        let mut actions = ControllerActions::default();
        if !self.is_awaited(now, config) {
            actions.stray = true;
            return actions;
        }
        if !matches!(self.progress, Progress::Starting { .. }) {
            self.note(now, ErrorCode::Format, config);
            return actions;
        }
        self.turn = Turn::Controller;
        match code {
            StartCode::Accept => {
                (self.progress, self.error) = (Progress::Running, ErrorCode::None);
                actions.start = Some(StartOutcome::Started);
            }
            StartCode::Repeat => actions.start = self.try_again(ErrorCode::None, config),
            StartCode::Refuse => actions.start = Some(StartOutcome::Refused),
        }
        actions
    }

    fn reply(
        &mut self,
        now: Duration,
        exception: Exception,
        has_room: bool,
        config: &ControllerConfig,
    ) -> ControllerActions {
        let mut actions = ControllerActions::default();
        let awaited = self.is_awaited(now, config);
        if !awaited {
            if config.keeps(ControllerRule::FirstReply) || self.progress != Progress::Running {
                actions.stray = true;
                return actions;
            }
        } else if matches!(self.progress, Progress::Starting { .. } | Progress::Ending) {
            self.note(now, ErrorCode::Format, config);
            return actions;
        } else if exception != Exception::None && !has_room {
            self.note(now, ErrorCode::Overflow, config);
            return actions;
        }
        if awaited {
            (self.turn, self.error) = (Turn::Controller, ErrorCode::None);
        }
        let running = self.progress == Progress::Running;
        let moves = running || !config.keeps(ControllerRule::RestInterrupted);
        let moves = moves && config.mode.uses_inputs();
        actions.taken = Some(if moves { Taken::Moves } else { Taken::Rests });
        // The subroutine runs already; a second exception does not start it again.
        if exception != Exception::None && (running || !config.keeps(ControllerRule::OneSubroutine)) {
            (actions.exception, self.progress) = if config.subroutine {
                let interrupted = Progress::Interrupted { reported: false, returned: false };
                (Some(Handling::Subroutine(exception)), interrupted)
            } else {
                (Some(Handling::Abort(exception)), Progress::Ending)
            };
        }
        actions
    }

    /// The window closed without a good reply.
    fn window_closed(&mut self, config: &ControllerConfig) -> ControllerActions {
        let mut actions = ControllerActions::default();
        let Turn::Host { corrupt, .. } = self.turn else { return actions };
        let code = corrupt.unwrap_or(ErrorCode::Timeout);
        (self.turn, self.error) = (Turn::Controller, code);
        (actions.bad_reply, actions.rest) = (Some(code), true);
        match self.progress {
            Progress::Starting { .. } => actions.start = self.try_again(code, config),
            // "da die Robotersteuerung bei Ausbleiben von Antwortpaketen den ALTER-Betrieb beendet" (§3.3.3)
            Progress::Running | Progress::Interrupted { .. }
                if code == ErrorCode::Timeout && config.keeps(ControllerRule::EndOnMissing) =>
            {
                self.progress = Progress::Ending;
            }
            Progress::Running | Progress::Interrupted { .. } | Progress::Ending => {}
        }
        actions
    }

    fn try_again(&mut self, code: ErrorCode, config: &ControllerConfig) -> Option<StartOutcome> {
        self.error = code;
        let Progress::Starting { attempts } = self.progress else { return None };
        let enough = attempts >= config.attempts || !config.keeps(ControllerRule::Attempts);
        enough.then_some(StartOutcome::GaveUp)
    }
}

fn refused(error: SessionError) -> ControllerActions {
    ControllerActions { refused: Some(error), ..ControllerActions::default() }
}
