//! Everything that the controller decides, with all that it depends on.

use core::time::Duration;

use robot_session::{Expiry, Machine, Unexpected, is_due};

use super::config::{ControllerConfig, Rule};
use crate::timing;
use crate::words::Refusal;

/// The controller's machine: sends only when asked, once for each frame (§3(1), §3(5)).
///
/// Every time in it is a deadline, and is compared with now and nothing else.
///
#[doc = include_str!("../../diagrams/controller.md")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ControllerMachine {
    /// What is done about the last frame.
    pub work: Work,
    /// What is received.
    pub line: Receiving,
}

/// What the controller does about the last frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Work {
    /// Nothing: it waits for a frame.
    Listening {
        /// Corrupt bytes came, and no frame since: an error code follows when the line is silent.
        fault: Option<Fault>,
    },
    /// The caller executes an immediate instruction or a query.
    Executing {
        /// Its command word.
        word: u16,
        /// Its connection is there: the answer has somewhere to go.
        connected: bool,
    },
    /// The answer waits for the end of the cycle.
    Answering {
        /// The answer.
        answer: Answer,
        /// The end of the cycle.
        due: Duration,
    },
}

/// Corrupt bytes that have not been answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Fault {
    /// What was wrong first.
    pub refusal: Refusal,
    /// How many bytes, as far as it matters: up to the length of the shortest frame.
    pub bytes: u8,
}

/// What the controller receives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Receiving {
    /// There is no connection.
    Disconnected,
    /// The line is silent.
    Silent,
    /// Bytes came.
    Bytes {
        /// When the line counts as silent.
        silent_at: Duration,
        /// The beginning of a frame is held.
        partial: bool,
    },
}

/// What the controller answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Answer {
    /// The command word of the first instruction; with values if it is a query.
    Echo(u16),
    /// An error code.
    Error(Refusal),
}

/// What happens to the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// The line was opened.
    Connected,
    /// The line is gone.
    Disconnected,
    /// Bytes came.
    Bytes,
    /// So many of them, up to 255, are no frame.
    Corrupt {
        /// How they are answered.
        refusal: Refusal,
        /// How many.
        bytes: u8,
    },
    /// A good frame whose instructions are queued.
    Queued {
        /// The command word of the first.
        word: u16,
    },
    /// A good frame that is refused.
    Refused(Refusal),
    /// A good frame with an instruction to execute.
    Immediate {
        /// Its command word.
        word: u16,
    },
    /// Every frame that was there has been read.
    Read {
        /// The beginning of another one is left.
        partial: bool,
    },
    /// Time has passed: the line is silent. The beginning of a frame that was held has been dropped, and has come as corrupt.
    Timeout,
    /// The caller has executed the instruction, or could not.
    Executed(Result<(), Refusal>),
    /// The answer that was due is put on the line.
    Sent,
}

/// What the controller does about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// Nothing.
    Nothing,
    /// Has the caller execute the instruction.
    Execute,
    /// Prepares the answer.
    Answer(Answer),
    /// Counts an answer.
    Sent,
}

impl Machine for ControllerMachine {
    const END: &'static str = "controller";
    const EXPIRY: Expiry = Expiry::BeforeTransmit;
    type Input = Input;
    type Action = Action;
    type Transmit = Answer;
    type Config = ControllerConfig;

    /// # Errors
    /// An input that the state does not allow. Neither line nor host can cause one.
    fn on(&mut self, now: Duration, input: Input, config: &ControllerConfig) -> Result<Action, Unexpected> {
        use {Action::Nothing, Input as On, Receiving as Line, Work as Is};
        let answer = |answer| {
            let due = timing::end_of_tick(now, config.tick);
            (Is::Answering { answer, due }, Action::Answer(answer))
        };
        let idle = Is::Listening { fault: None };
        let (work, line, action) = match (self.work, self.line, input) {
            // What is being executed goes on, but has nobody to answer.
            (Is::Executing { word, .. }, _, On::Connected) => {
                (Is::Executing { word, connected: false }, Line::Silent, Nothing)
            }
            (Is::Executing { word, .. }, _, On::Disconnected) => {
                (Is::Executing { word, connected: false }, Line::Disconnected, Nothing)
            }
            (Is::Listening { .. } | Is::Answering { .. }, _, On::Connected) => (idle, Line::Silent, Nothing),
            (Is::Listening { .. } | Is::Answering { .. }, _, On::Disconnected) => {
                (idle, Line::Disconnected, Nothing)
            }
            (work, Line::Silent, On::Bytes) => {
                let silent_at = now.saturating_add(config.silence);
                (work, Line::Bytes { silent_at, partial: false }, Nothing)
            }
            (work, Line::Bytes { partial, .. }, On::Bytes) => {
                let silent_at = now.saturating_add(config.silence);
                (work, Line::Bytes { silent_at, partial }, Nothing)
            }
            // No silence is awaited any more.
            (work @ Is::Answering { .. }, Line::Bytes { silent_at, .. }, On::Read { partial: false })
                if is_due(silent_at, now) =>
            {
                (work, Line::Silent, Nothing)
            }
            (work, Line::Bytes { silent_at, .. }, On::Read { partial }) => {
                (work, Line::Bytes { silent_at, partial }, Nothing)
            }
            (work, Line::Silent, On::Read { partial: false }) => (work, Line::Silent, Nothing),
            // What was executed had nobody left to answer.
            (work @ Is::Listening { .. }, Line::Disconnected, On::Read { partial: false }) => {
                (work, Line::Disconnected, Nothing)
            }
            (Is::Listening { fault }, line @ Line::Bytes { .. }, On::Corrupt { refusal, bytes }) => {
                let fault = fault.unwrap_or(Fault { refusal, bytes: 0 });
                let bytes = fault.bytes.saturating_add(bytes).min(Fault::ENOUGH);
                (Is::Listening { fault: Some(Fault { bytes, ..fault }) }, line, Nothing)
            }
            // Two answers to one frame would make the host send it again, and the robot execute it twice.
            (work @ Is::Answering { .. }, line @ Line::Bytes { .. }, On::Corrupt { .. }) => {
                (work, line, Nothing)
            }
            // A frame that comes before the last one is answered shows that the host has stopped waiting for that answer.
            (Is::Listening { .. } | Is::Answering { .. }, line @ Line::Bytes { .. }, On::Queued { word }) => {
                let (work, action) = answer(Answer::Echo(word));
                (work, line, action)
            }
            (
                Is::Listening { .. } | Is::Answering { .. },
                line @ Line::Bytes { .. },
                On::Refused(refusal),
            ) => {
                let (work, action) = answer(Answer::Error(refusal));
                (work, line, action)
            }
            (
                Is::Listening { .. } | Is::Answering { .. },
                line @ Line::Bytes { .. },
                On::Immediate { word },
            ) => (Is::Executing { word, connected: true }, line, Action::Execute),
            (Is::Listening { fault: Some(fault) }, Line::Bytes { .. }, On::Timeout)
                if fault.bytes >= Fault::ENOUGH || !config.rules.keeps(Rule::IgnoreShort) =>
            {
                let (work, action) = answer(Answer::Error(fault.refusal));
                (work, Line::Silent, action)
            }
            (Is::Listening { .. }, Line::Bytes { .. }, On::Timeout) => (idle, Line::Silent, Nothing),
            (work @ Is::Answering { .. }, Line::Bytes { .. }, On::Timeout) => (work, Line::Silent, Nothing),
            (Is::Executing { connected: false, .. }, line, On::Executed(_)) => (idle, line, Nothing),
            (Is::Executing { word, connected: true }, line, On::Executed(result)) => {
                let (work, action) = answer(result.map_or_else(Answer::Error, |()| Answer::Echo(word)));
                (work, line, action)
            }
            (Is::Answering { .. }, line, On::Sent) if self.due(now).is_some() => {
                (idle, line.at(now), Action::Sent)
            }
            (_, Line::Disconnected, On::Bytes | On::Read { .. } | On::Timeout)
            | (_, Line::Silent, On::Read { partial: true } | On::Timeout)
            | (_, Line::Disconnected | Line::Silent, On::Corrupt { .. })
            | (
                _,
                Line::Disconnected | Line::Silent,
                On::Queued { .. } | On::Refused(_) | On::Immediate { .. },
            )
            | (
                Is::Executing { .. },
                Line::Bytes { .. },
                On::Corrupt { .. } | On::Queued { .. } | On::Refused(_) | On::Immediate { .. } | On::Timeout,
            )
            | (Is::Listening { .. } | Is::Answering { .. }, _, On::Executed(_))
            | (_, _, On::Sent) => return Err(self.unexpected(&input)),
        };
        (self.work, self.line) = (work, line);
        Ok(action)
    }

    fn transmit(&self, now: Duration, _config: &ControllerConfig) -> Option<Answer> {
        self.due(now)
    }

    fn deadline(&self) -> Option<Duration> {
        let due = match self.work {
            Work::Answering { due, .. } if self.line != Receiving::Disconnected => Some(due),
            Work::Answering { .. } | Work::Listening { .. } | Work::Executing { .. } => None,
        };
        self.silent_at().or(due).filter(|at| *at < Duration::MAX)
    }

    fn expires(&self, now: Duration) -> bool {
        self.silent_at().is_some_and(|at| is_due(at, now))
    }

    /// The beginning of a frame is dropped when the line has been silent.
    fn cuts(&self) -> bool {
        true
    }

    /// Not while an instruction is executed: what comes meanwhile is read after that.
    fn reads(&self) -> bool {
        !matches!(self.work, Work::Executing { .. })
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        if let Work::Answering { due, .. } = &mut self.work {
            f(due);
        }
        if let Receiving::Bytes { silent_at, .. } = &mut self.line {
            f(silent_at);
        }
    }

    fn name(&self) -> &'static str {
        match (self.line, self.work) {
            (Receiving::Disconnected, Work::Listening { .. } | Work::Answering { .. }) => "Disconnected",
            (Receiving::Disconnected, Work::Executing { .. }) => "DisconnectedExecuting",
            (Receiving::Silent | Receiving::Bytes { .. }, Work::Listening { fault: None }) => "Listening",
            (Receiving::Silent | Receiving::Bytes { .. }, Work::Listening { fault: Some(_) }) => {
                "ListeningFault"
            }
            (Receiving::Silent | Receiving::Bytes { .. }, Work::Executing { .. }) => "Executing",
            (Receiving::Silent | Receiving::Bytes { .. }, Work::Answering { .. }) => "Answering",
        }
    }
}

impl ControllerMachine {
    /// A controller without a connection.
    pub const NEW: Self = Self { work: Work::Listening { fault: None }, line: Receiving::Disconnected };

    /// Whether there is a connection: without one nothing is read.
    pub fn is_connected(&self) -> bool {
        self.line != Receiving::Disconnected
    }

    /// The answer that is to be put on the line. It waits while the rest of a frame may come.
    fn due(&self, now: Duration) -> Option<Answer> {
        let is_receiving = matches!(self.line, Receiving::Bytes { partial: true, .. });
        match self.work {
            Work::Answering { answer, due } if is_due(due, now) && !is_receiving => Some(answer),
            Work::Answering { .. } | Work::Listening { .. } | Work::Executing { .. } => None,
        }
    }

    /// When a silence is awaited: not while an instruction is executed, and not beside an answer that nothing holds up.
    fn silent_at(&self) -> Option<Duration> {
        match (self.work, self.line) {
            (Work::Listening { .. }, Receiving::Bytes { silent_at, .. })
            | (Work::Answering { .. }, Receiving::Bytes { silent_at, partial: true }) => Some(silent_at),
            (Work::Listening { .. } | Work::Executing { .. } | Work::Answering { .. }, _) => None,
        }
    }
}

impl Receiving {
    /// The same, unless it is silent now.
    fn at(self, now: Duration) -> Self {
        match self {
            Self::Bytes { silent_at, .. } if is_due(silent_at, now) => Self::Silent,
            Self::Disconnected | Self::Silent | Self::Bytes { .. } => self,
        }
    }
}

impl Fault {
    /// The length of the shortest frame: fewer bytes are no frame that somebody waits for.
    pub const ENOUGH: u8 = 8;
}

robot_session::inputs!(Input: Bytes, Corrupt, Queued, Refused, Immediate, Read, Executed, Sent);
