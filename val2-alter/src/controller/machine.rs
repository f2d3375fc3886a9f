//! The controller's machine: everything that decides what the controller does, and nothing else.

use core::time::Duration;

use robot_session::Unexpected;

use super::config::{ControllerConfig, ControllerRule};
use crate::error::SessionError;
use crate::message::{ErrorCode, Exception, MotionPhase, StartCode};
use crate::timing::{Budget, CYCLE};

/// The state of a controller.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct ControllerMachine {
    /// What is going on.
    pub phase: ControllerPhase,
    /// When a silence ends the frame that has begun.
    pub gap_at: Option<Duration>,
}

/// What is going on.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum ControllerPhase {
    /// The port is not open.
    Disconnected,
    /// No ALTER.
    Off,
    /// The ALTER instruction is executed.
    On(Alter),
}

/// An ALTER.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Alter {
    /// How far it is.
    pub progress: Progress,
    /// Whose turn it is.
    pub turn: Turn,
    /// What the next message says of the last reply.
    pub error: ErrorCode,
    /// When the next message is to be sent, while a window is open not before that closes.
    pub slot: Duration,
    /// The slot after it.
    pub following: Duration,
}

/// How far an ALTER is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Progress {
    /// Start messages are sent until one is accepted or there were enough.
    Starting {
        /// Start messages sent.
        attempts: u8,
    },
    /// The replies move the arm.
    Running,
    /// The exception subroutine runs: the replies move nothing.
    Interrupted {
        /// A message said so.
        reported: bool,
        /// The subroutine has returned.
        returned: bool,
    },
    /// The end message is to be sent.
    Ending,
}

/// Whose turn it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Turn {
    /// The controller's: the next message waits for its slot.
    Controller,
    /// The host's: its answer is awaited.
    Host {
        /// When the window closes.
        closes: Duration,
        /// What was wrong first in this window.
        corrupt: Option<ErrorCode>,
    },
}

/// What the session understood.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ControllerInput {
    /// The port was opened.
    Connected,
    /// The port is gone.
    Disconnected,
    /// Bytes came, and a frame has begun that is not whole, or not.
    Bytes {
        /// A frame has begun.
        partial: bool,
    },
    /// An answer to a start message.
    StartReply(StartCode),
    /// An answer to a standard message.
    Reply {
        /// Its exception.
        exception: Exception,
        /// There is room to report it.
        has_room: bool,
    },
    /// Bytes that are no message, by their code.
    Corrupt(ErrorCode),
    /// Time has passed.
    Timeout,
    /// The window's time has come, and all that was received was read.
    WindowClosed,
    /// The message that is due, of so many bytes, can be sent.
    Transmit {
        /// Its length.
        len: u8,
    },
    /// The program executes its ALTER instruction.
    Start {
        /// There is room for its outcomes.
        has_room: bool,
    },
    /// The program ends ALTER.
    Finish,
    /// The exception subroutine returns.
    Return,
}

/// What the session is to do: everything that is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct ControllerActions {
    /// End the frame that has begun.
    pub end_frame: bool,
    /// End the frame that has begun, then give [`ControllerInput::WindowClosed`].
    pub close_window: bool,
    /// Send the message.
    pub send: Option<Outgoing>,
    /// A new ALTER: all words are zero.
    pub restart: bool,
    /// A reply was taken, and moves the arm or does not.
    pub taken: Option<Taken>,
    /// The arm is at rest in this cycle.
    pub rest: bool,
    /// Report a reply that could not be read, or did not come.
    pub bad_reply: Option<ErrorCode>,
    /// Report an exception: the subroutine begins, or the program is aborted.
    pub exception: Option<Handling>,
    /// Report what became of the start.
    pub start: Option<StartOutcome>,
    /// Report the end of ALTER.
    pub ended: Option<ErrorCode>,
    /// Report a message that no window was open for.
    pub stray: bool,
    /// The caller's request is not possible.
    pub refused: Option<SessionError>,
}

/// A message that is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Outgoing {
    /// A start message.
    Start(ErrorCode),
    /// A standard message.
    Motion(MotionPhase, ErrorCode),
    /// An end message.
    End(ErrorCode),
}

/// What a reply does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Taken {
    /// Its values move the arm.
    Moves,
    /// The arm does not use them.
    Rests,
}

/// What becomes of an exception.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Handling {
    /// The subroutine begins.
    Subroutine(Exception),
    /// There is none: the program is aborted.
    Abort(Exception),
}

/// What became of a start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum StartOutcome {
    /// The host accepted.
    Started,
    /// The host refused.
    Refused,
    /// There were enough attempts.
    GaveUp,
}

type Step = Result<ControllerActions, Unexpected>;

impl ControllerMachine {
    /// A controller whose port is not open.
    pub const NEW: Self = Self { phase: ControllerPhase::Disconnected, gap_at: None };

    /// Takes an input; on an error nothing has changed.
    ///
    /// # Errors
    /// [`Unexpected`]: the port is not open, or it is not the time.
    pub fn on(&mut self, now: Duration, input: ControllerInput, config: &ControllerConfig) -> Step {
        use {ControllerInput as On, ControllerPhase as Is};
        let nothing = ControllerActions::default();
        let unexpected = Unexpected { state: self.name(), input: input.name() };
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
            (Is::Disconnected | Is::Off, On::Finish | On::Return) => {
                return Ok(refused(SessionError::NotRunning));
            }
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
            ) => return Err(unexpected),
            (_, On::Bytes { partial }) => {
                self.gap_at = config.gap.filter(|_| partial).map(|gap| now.saturating_add(gap));
            }
            (Is::Off, On::StartReply(_) | On::Reply { .. }) => {
                return Ok(ControllerActions { stray: true, ..nothing });
            }
            (Is::Off, On::Corrupt(_)) => {}
            (Is::On(alter), On::Corrupt(code)) => alter.note(code),
            (Is::On(alter), On::StartReply(code)) => {
                let actions = alter.start_reply(code, config);
                return Ok(self.end_start(actions));
            }
            (Is::On(alter), On::Reply { exception, has_room }) => {
                return Ok(alter.reply(exception, has_room, config));
            }
            (Is::On(Alter { turn: Turn::Host { closes, .. }, .. }), On::WindowClosed) if *closes > now => {
                return Err(unexpected);
            }
            (Is::On(alter), On::WindowClosed) => {
                let actions = alter.window_closed(config);
                return Ok(self.end_start(actions));
            }
            (Is::Disconnected | Is::Off, On::WindowClosed) => {}
            (Is::On(_), On::Transmit { len }) => {
                let Some(message) = self.due(now) else { return Err(unexpected) };
                return Ok(self.transmit(now, message, len, config));
            }
            (Is::Off, On::Transmit { .. }) => return Err(unexpected),
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

    /// When [`ControllerInput::Timeout`] or the next message is due.
    pub fn deadline(&self) -> Option<Duration> {
        let turn = match &self.phase {
            ControllerPhase::Disconnected | ControllerPhase::Off => None,
            ControllerPhase::On(alter) => Some(match alter.turn {
                Turn::Controller => alter.slot,
                Turn::Host { closes, .. } => closes,
            }),
        };
        [turn, self.gap_at].into_iter().flatten().min()
    }

    /// Visits every time in the state.
    pub fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        self.gap_at.iter_mut().for_each(&mut f);
        if let ControllerPhase::On(alter) = &mut self.phase {
            f(&mut alter.slot);
            f(&mut alter.following);
            if let Turn::Host { closes, .. } = &mut alter.turn {
                f(closes);
            }
        }
    }

    /// The state's name.
    pub const fn name(&self) -> &'static str {
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
        let closes = now.saturating_add(budget.request).saturating_add(budget.window);
        // On a raster of 28 ms; late once, the next one keeps its window too.
        alter.slot = alter.following.max(closes);
        alter.following = alter.slot.saturating_add(CYCLE);
        alter.turn = Turn::Host { closes, corrupt: None };
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
    /// The first fault of a window counts.
    fn note(&mut self, code: ErrorCode) {
        if let Turn::Host { corrupt, .. } = &mut self.turn {
            corrupt.get_or_insert(code);
        }
    }

    fn start_reply(&mut self, code: StartCode, config: &ControllerConfig) -> ControllerActions {
        let mut actions = ControllerActions::default();
        if self.turn == Turn::Controller {
            actions.stray = true;
            return actions;
        }
        if !matches!(self.progress, Progress::Starting { .. }) {
            self.note(ErrorCode::Format);
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
        exception: Exception,
        has_room: bool,
        config: &ControllerConfig,
    ) -> ControllerActions {
        let mut actions = ControllerActions::default();
        if self.turn == Turn::Controller {
            if config.keeps(ControllerRule::FirstReply) || self.progress != Progress::Running {
                actions.stray = true;
                return actions;
            }
        } else if matches!(self.progress, Progress::Starting { .. } | Progress::Ending) {
            self.note(ErrorCode::Format);
            return actions;
        } else if exception != Exception::None && !has_room {
            self.note(ErrorCode::Overflow);
            return actions;
        }
        (self.turn, self.error) = (Turn::Controller, ErrorCode::None);
        let running = self.progress == Progress::Running;
        let moves = running || !config.keeps(ControllerRule::RestInterrupted);
        let moves = moves && config.mode.uses_inputs();
        actions.taken = Some(if moves { Taken::Moves } else { Taken::Rests });
        actions.rest = !running;
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

impl ControllerInput {
    /// The input's name.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Connected => "connected",
            Self::Disconnected => "disconnected",
            Self::Bytes { .. } => "bytes",
            Self::StartReply(StartCode::Accept) => "accept",
            Self::StartReply(StartCode::Repeat) => "repeat",
            Self::StartReply(StartCode::Refuse) => "refuse",
            Self::Reply { exception: Exception::None, .. } => "reply",
            Self::Reply { .. } => "reply with an exception",
            Self::Corrupt(_) => "corrupt bytes",
            Self::Timeout => "timeout",
            Self::WindowClosed => "window closed",
            Self::Transmit { .. } => "transmit",
            Self::Start { .. } => "start",
            Self::Finish => "finish",
            Self::Return => "return",
        }
    }
}

fn refused(error: SessionError) -> ControllerActions {
    ControllerActions { refused: Some(error), ..ControllerActions::default() }
}
