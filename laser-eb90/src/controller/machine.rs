//! Everything that the controller decides, with all that it depends on.

use core::time::Duration;

use robot_session::Unexpected;
use robot_session::end::{Expiry, Machine, is_due};

use super::config::{ControllerConfig, Rule};
use crate::timing;
use crate::words::Refusal;

/// The controller's machine: sends only in reply, once for each frame (§3(1), §3(5)).
///
/// Every time in the state is a deadline, which is compared with the current time alone.
///
#[doc = include_str!("../../diagrams/controller.md")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ControllerMachine {
    /// The work on the last frame.
    pub work: Work,
    /// The state of the line.
    pub line: LineState,
}

/// The controller's work on the last frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Work {
    /// There is no work: it waits for a frame.
    Listening {
        /// Whether bytes without a head are the rest of the last answered frame, until a frame begins.
        rest: bool,
    },
    /// The caller executes an immediate instruction or a query.
    Executing {
        /// The command word of the instruction.
        word: u16,
        /// Whether its connection still exists: otherwise the answer is dropped.
        connected: bool,
    },
    /// The answer waits for the end of the cycle.
    Answering {
        /// The echo or the error code to send.
        answer: Answer,
        /// The time at which the cycle ends, and the answer is sent.
        due: Duration,
    },
}

/// Bytes that are not a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Fault {
    /// The error code of the first error in the bytes.
    pub refusal: Refusal,
    /// The number of bytes, limited to the length of the shortest frame.
    pub bytes: u8,
    /// Whether an error code follows when the line is silent.
    pub is_answered: bool,
}

/// The state of the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LineState {
    /// There is no connection.
    Disconnected,
    /// There is a connection, and no bytes came since the last silence.
    Silent,
    /// Bytes came since the last silence.
    Bytes(Burst),
}

/// Bytes between two silences.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Burst {
    /// The time at which the line counts as silent.
    pub silent_at: Duration,
    /// Whether the beginning of a frame is held.
    pub partial: bool,
    /// The corrupt bytes; `None` if no such bytes have come since the last accepted frame.
    pub fault: Option<Fault>,
}

/// An answer of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Answer {
    /// The command word of the first instruction; with values if it is a query.
    Echo(u16),
    /// An error code: the frame is refused.
    Error(Refusal),
}

/// An input of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Input {
    /// The caller has opened the line.
    Connected,
    /// The caller reports that the line is gone.
    Disconnected,
    /// Bytes came; given before they are decoded.
    Bytes,
    /// Bytes that are not a frame.
    Corrupt {
        /// The error code of the answer.
        refusal: Refusal,
        /// The number of bytes, at most 255.
        bytes: u8,
        /// Whether they begin as a frame does, as far as they go.
        begun: bool,
    },
    /// A good frame that [is not trusted](ControllerMachine::trusts).
    Untrusted,
    /// A good frame whose instructions are queued.
    Queued {
        /// The command word of the first instruction.
        word: u16,
    },
    /// A good frame that is refused.
    Refused(Refusal),
    /// A good frame with an instruction to execute.
    Immediate {
        /// The command word of the instruction.
        word: u16,
    },
    /// Every frame that was there has been read.
    Read {
        /// Whether the beginning of another one remains.
        partial: bool,
    },
    /// Time has passed: the line is silent. The beginning of a frame that was held has been dropped, and has come as corrupt.
    Timeout,
    /// The caller has executed the instruction, or could not.
    Executed(Result<(), Refusal>),
    /// The answer that was due is put on the line.
    Sent,
}

/// An action of the controller after an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// The session has nothing to do.
    Nothing,
    /// Has the caller execute the instruction.
    Execute,
    /// Prepares the answer, which is sent at the end of the cycle.
    Answer(Answer),
    /// Counts an answer that was sent.
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
        use {Action::Nothing, Input as On, LineState as Line, Work as Is};
        let answer = |answer| {
            let due = timing::end_of_tick(now, config.tick);
            (Is::Answering { answer, due }, Action::Answer(answer))
        };
        // A frame that is accepted ends the corruption before it.
        let good = |burst| Line::Bytes(Burst { fault: None, ..burst });
        let idle = Is::Listening { rest: false };
        let is_good = matches!(input, On::Queued { .. } | On::Refused(_) | On::Immediate { .. });
        if is_good && !self.trusts(config) {
            return Err(self.unexpected(&input));
        }
        let (work, line, action) = match (self.work, self.line, input) {
            // Execution continues, but without an answer.
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
                (work, Line::Bytes(Burst { silent_at, partial: false, fault: None }), Nothing)
            }
            (work, Line::Bytes(burst), On::Bytes) => {
                let silent_at = now.saturating_add(config.silence);
                (work, Line::Bytes(Burst { silent_at, ..burst }), Nothing)
            }
            // No silence is awaited any more.
            (work @ Is::Answering { .. }, Line::Bytes(burst), On::Read { partial: false })
                if is_due(burst.silent_at, now) =>
            {
                (work, Line::Silent, Nothing)
            }
            (work, Line::Bytes(burst), On::Read { partial }) => {
                (work, Line::Bytes(Burst { partial, ..burst }), Nothing)
            }
            (work, Line::Silent, On::Read { partial: false }) => (work, Line::Silent, Nothing),
            // The execution had no client left to answer.
            (work @ Is::Listening { .. }, Line::Disconnected, On::Read { partial: false }) => {
                (work, Line::Disconnected, Nothing)
            }
            (
                work @ (Is::Listening { .. } | Is::Answering { .. }),
                Line::Bytes(burst),
                On::Corrupt { refusal, bytes, begun },
            ) => {
                let (work, is_answered) = match work {
                    // After the rest of a frame, less than a head may be more of it, and less than a frame the end of its
                    // tail.
                    Is::Listening { rest: true } if config.keeps(Rule::IgnoreRest) => {
                        let begins = begun && bytes >= Fault::HEAD;
                        let is_enough = burst.fault.is_none() || bytes >= Fault::MIN_BYTES;
                        (Is::Listening { rest: !begins }, begins && is_enough)
                    }
                    Is::Listening { .. } => (work, true),
                    // Two answers to one frame would make the host send it again, and the robot execute it twice.
                    Is::Answering { .. } | Is::Executing { .. } => (work, false),
                };
                let fault = burst.fault.unwrap_or(Fault { refusal, bytes: 0, is_answered });
                let fault = Fault {
                    bytes: fault.bytes.saturating_add(bytes).min(Fault::MIN_BYTES),
                    is_answered: fault.is_answered || is_answered,
                    ..fault
                };
                (work, Line::Bytes(Burst { fault: Some(fault), ..burst }), Nothing)
            }
            // The host waits for the answer to this frame, and for no older one.
            (
                Is::Listening { .. } | Is::Answering { .. },
                Line::Bytes(burst @ Burst { fault: Some(fault), .. }),
                On::Untrusted,
            ) if fault.is_enough() => {
                let fault = Some(Fault { is_answered: true, ..fault });
                (idle, Line::Bytes(Burst { fault, ..burst }), Nothing)
            }
            // A frame that comes before the last one is answered shows that the host has stopped waiting for that answer.
            (Is::Listening { .. } | Is::Answering { .. }, Line::Bytes(burst), On::Queued { word }) => {
                let (work, action) = answer(Answer::Echo(word));
                (work, good(burst), action)
            }
            (Is::Listening { .. } | Is::Answering { .. }, Line::Bytes(burst), On::Refused(refusal)) => {
                let (work, action) = answer(Answer::Error(refusal));
                (work, good(burst), action)
            }
            (Is::Listening { .. } | Is::Answering { .. }, Line::Bytes(burst), On::Immediate { word }) => {
                (Is::Executing { word, connected: true }, good(burst), Action::Execute)
            }
            (
                Is::Listening { .. },
                Line::Bytes(Burst { fault: Some(fault @ Fault { is_answered: true, .. }), .. }),
                On::Timeout,
            ) if fault.is_enough() || !config.keeps(Rule::IgnoreShort) => {
                let (work, action) = answer(Answer::Error(fault.refusal));
                (work, Line::Silent, action)
            }
            (work @ (Is::Listening { .. } | Is::Answering { .. }), Line::Bytes(_), On::Timeout) => {
                (work, Line::Silent, Nothing)
            }
            (Is::Executing { connected: false, .. }, line, On::Executed(_)) => (idle, line, Nothing),
            (Is::Executing { word, connected: true }, line, On::Executed(result)) => {
                let (work, action) = answer(result.map_or_else(Answer::Error, |()| Answer::Echo(word)));
                (work, line, action)
            }
            (Is::Answering { answer, .. }, line, On::Sent) if self.due(now).is_some() => {
                let rest = answer.is_to_corrupt_bytes() || line.fault().is_some();
                (Is::Listening { rest }, line.at(now), Action::Sent)
            }
            (_, Line::Disconnected, On::Bytes | On::Read { .. } | On::Timeout)
            | (_, Line::Silent, On::Read { partial: true } | On::Timeout)
            | (
                _,
                Line::Disconnected | Line::Silent,
                On::Corrupt { .. } | On::Queued { .. } | On::Refused(_) | On::Immediate { .. },
            )
            | (
                Is::Executing { .. },
                Line::Bytes(_),
                On::Corrupt { .. } | On::Queued { .. } | On::Refused(_) | On::Immediate { .. } | On::Timeout,
            )
            | (Is::Listening { .. } | Is::Answering { .. }, _, On::Executed(_))
            | (_, _, On::Untrusted | On::Sent) => return Err(self.unexpected(&input)),
        };
        (self.work, self.line) = (work, line);
        Ok(action)
    }

    fn transmit(&self, now: Duration, _config: &ControllerConfig) -> Option<Answer> {
        self.due(now)
    }

    fn deadline(&self) -> Option<Duration> {
        let due = match self.work {
            Work::Answering { due, .. } => Some(due),
            Work::Listening { .. } | Work::Executing { .. } => None,
        };
        self.silent_at().or(due).filter(|at| *at < Duration::MAX)
    }

    fn expires(&self, now: Duration) -> bool {
        self.silent_at().is_some_and(|at| is_due(at, now))
    }

    /// Returns whether the beginning of a frame is dropped when the line has been silent.
    fn cuts(&self) -> bool {
        true
    }

    /// Returns false while an instruction is executed: bytes that arrive meanwhile are read after that.
    fn reads(&self) -> bool {
        !matches!(self.work, Work::Executing { .. })
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        if let Work::Answering { due, .. } = &mut self.work {
            f(due);
        }
        if let LineState::Bytes(burst) = &mut self.line {
            f(&mut burst.silent_at);
        }
    }

    fn name(&self) -> &'static str {
        match (self.line, self.work) {
            (LineState::Disconnected, Work::Listening { .. } | Work::Answering { .. }) => "Disconnected",
            (LineState::Disconnected, Work::Executing { .. }) => "DisconnectedExecuting",
            (_, Work::Executing { .. }) => "Executing",
            (_, Work::Answering { .. }) => "Answering",
            (line, Work::Listening { rest }) => match line.fault() {
                Some(Fault { is_answered: true, .. }) => "ListeningFault",
                _ if rest => "ListeningRest",
                Some(_) | None => "Listening",
            },
        }
    }
}

impl ControllerMachine {
    /// A controller without a connection.
    pub const NEW: Self = Self { work: Work::Listening { rest: false }, line: LineState::Disconnected };

    /// Returns whether there is a connection: without one no bytes are read.
    pub fn is_connected(&self) -> bool {
        self.line != LineState::Disconnected
    }

    /// Returns whether a good frame is accepted. After corrupt bytes it is not, before the line is silent: it may be
    /// out of the middle of another frame. A few bytes of noise do not count.
    pub fn trusts(&self, config: &ControllerConfig) -> bool {
        !self.line.fault().is_some_and(|fault| fault.is_enough()) || !config.keeps(Rule::TrustSilence)
    }

    /// Returns the answer to put on the line. The answer waits while the rest of a frame may come.
    fn due(&self, now: Duration) -> Option<Answer> {
        let is_receiving = matches!(self.line, LineState::Bytes(Burst { partial: true, .. }));
        match self.work {
            Work::Answering { answer, due } if is_due(due, now) && !is_receiving => Some(answer),
            Work::Answering { .. } | Work::Listening { .. } | Work::Executing { .. } => None,
        }
    }

    /// Returns the time of an awaited silence: none while an instruction is executed, and none beside an answer that
    /// nothing holds up.
    fn silent_at(&self) -> Option<Duration> {
        match (self.work, self.line) {
            (Work::Listening { .. }, LineState::Bytes(burst))
            | (Work::Answering { .. }, LineState::Bytes(burst @ Burst { partial: true, .. })) => {
                Some(burst.silent_at)
            }
            (Work::Listening { .. } | Work::Executing { .. } | Work::Answering { .. }, _) => None,
        }
    }
}

impl LineState {
    /// Returns the state at `now`: unchanged, unless the line has become silent.
    fn at(self, now: Duration) -> Self {
        match self {
            Self::Bytes(burst) if is_due(burst.silent_at, now) => Self::Silent,
            Self::Disconnected | Self::Silent | Self::Bytes(_) => self,
        }
    }

    fn fault(self) -> Option<Fault> {
        match self {
            Self::Bytes(burst) => burst.fault,
            Self::Disconnected | Self::Silent => None,
        }
    }
}

impl Fault {
    /// The length of the shortest frame: fewer bytes are not a frame.
    pub const MIN_BYTES: u8 = 8;
    /// The length of a head.
    const HEAD: u8 = 3;

    fn is_enough(self) -> bool {
        self.bytes >= Self::MIN_BYTES
    }
}

impl Answer {
    /// Returns whether the answer reports corrupt bytes: more of them may follow.
    fn is_to_corrupt_bytes(self) -> bool {
        matches!(self, Self::Error(Refusal::BadChecksum | Refusal::BadFrame))
    }
}

robot_session::inputs!(Input: Bytes, Corrupt, Untrusted, Queued, Refused, Immediate, Read, Executed, Sent);
