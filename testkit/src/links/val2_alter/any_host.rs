//! A controller against hosts that are not ours.

use core::time::Duration;

use val2_alter::controller::machine::{
    Action, ControllerMachine, ControllerPhase, Handling, Input, Outgoing, StartOutcome, Taken,
};
use val2_alter::timing::Budget;
use val2_alter::{ControllerConfig, ErrorCode, Exception, MotionPhase, StartCode};

use super::setup::TICK;
use super::world::{GRIP, INFORMED, Message, NESTED, TRIES, UNASKED};
use crate::model::{By, Cause, CauseOf, EXPECTED, InputOf, Peer, STANDSTILL, Terms};

/// Ticks after which every window has closed.
const LONG: u8 = 5;

pub(super) const TAKEN: &str = "one answer to a message is taken at most, in its window";
pub(super) const REPORTED: &str = "a message has the error of the window before, and no reply ends ALTER";
pub(super) const APART: &str = "a message is sent when the window of the one before is over, and in an ALTER";
pub(super) const ENDED: &str = "each ALTER has one end";

const PROPERTIES: &[&str] =
    &[TAKEN, REPORTED, APART, ENDED, NESTED, INFORMED, UNASKED, TRIES, STANDSTILL, EXPECTED];
pub(super) const RULES: Terms = Terms {
    keeps: "AL-53, AL-54, AL-67",
    free: "whether and when it answers and what, what is lost, corrupt, in pieces or late",
    shows: &[],
    properties: PROPERTIES,
};
pub(super) const ANYTHING: Terms =
    Terms { keeps: "", free: "any message and noise at any time", shows: &[], properties: PROPERTIES };

/// A host of which only this is known.
#[derive(Debug, Clone, Copy)]
pub struct AnyHost {
    /// The controller's configuration.
    pub config: ControllerConfig,
    /// It answers a message once at most and by its kind (AL-53, AL-54), without an exception in an interruption (AL-67). When the answer
    /// comes is open.
    pub keeps_rules: bool,
}

/// What is known of the line and the program.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Known {
    /// The message that the host may answer.
    pending: Option<Outgoing>,
    /// The head of a frame has come.
    held: bool,
    /// It is given up, and to be read; it is just read.
    cut: bool,
    read: bool,
    /// An ALTER has no end.
    open: bool,
    /// Start messages sent in it.
    attempts: u8,
    /// What the window of the last message has brought.
    window: Window,
    /// It was found over.
    closed: bool,
    /// Ticks since that message, and its length.
    since_sent: u8,
    len: u8,
    /// The subroutine runs; no message has said so.
    interrupted: bool,
    unreported: bool,
    wrong: Option<&'static str>,
}

/// What the window of a message has brought.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Window {
    Nothing,
    Good,
    Fault(ErrorCode),
}

/// What happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Word {
    /// An answer to a start message comes.
    Start(StartCode),
    /// A reply comes.
    Reply {
        /// With an exception.
        exception: bool,
        /// There is room to report it.
        has_room: bool,
    },
    /// The head of a frame comes.
    Head,
    /// Bytes come that are no message.
    Corrupt,
    /// The program executes its ALTER instruction.
    Begin,
    /// It ends ALTER.
    Finish,
    /// It runs a subroutine by itself.
    Interrupt,
    /// The subroutine returns.
    Return,
}

const STARTS: [Word; 3] =
    [Word::Start(StartCode::Accept), Word::Start(StartCode::Repeat), Word::Start(StartCode::Refuse)];
const REPLY: Word = Word::Reply { exception: false, has_room: true };
const EXCEPTIONS: [Word; 2] =
    [Word::Reply { exception: true, has_room: true }, Word::Reply { exception: true, has_room: false }];

impl Peer for AnyHost {
    type End = ControllerMachine;
    type Known = Known;
    type Word = Word;

    const TICK: Duration = TICK;

    fn config(&self) -> &ControllerConfig {
        &self.config
    }

    fn end(&self) -> ControllerMachine {
        ControllerMachine::NEW
    }

    fn known(&self) -> Known {
        Known {
            pending: None,
            held: false,
            cut: false,
            read: false,
            open: false,
            attempts: 0,
            window: Window::Good,
            closed: false,
            since_sent: LONG,
            len: 0,
            interrupted: false,
            unreported: false,
            wrong: None,
        }
    }

    fn words(&self, end: &ControllerMachine, known: &Known, words: &mut Vec<Word>) {
        words.extend([Word::Begin, Word::Finish, Word::Interrupt, Word::Return]);
        if end.phase == ControllerPhase::Disconnected {
            return;
        }
        words.extend([Word::Head, Word::Corrupt]);
        let (starts, replies, exceptions) = match known.pending {
            _ if !self.keeps_rules => (true, true, true),
            Some(Outgoing::Start(_)) => (true, false, false),
            Some(Outgoing::Motion(phase, _)) => (false, true, phase == MotionPhase::Running),
            Some(Outgoing::End(_)) | None => (false, false, false),
        };
        if starts {
            words.extend(STARTS);
        }
        if replies {
            words.push(REPLY);
        }
        if exceptions {
            words.extend(EXCEPTIONS);
        }
    }

    fn by(&self, word: Word) -> By {
        match word {
            Word::Start(_) | Word::Reply { .. } | Word::Head | Word::Corrupt => By::Line,
            Word::Begin | Word::Finish | Word::Interrupt | Word::Return => By::User,
        }
    }

    fn hear(&self, _: &ControllerMachine, known: &mut Known, word: Word) -> Option<InputOf<Self>> {
        if self.by(word) == By::Line {
            // The rest of a frame is the answer, or spoils it.
            known.held = word == Word::Head;
        }
        Some(match word {
            Word::Start(code) => {
                known.pending = None;
                Input::StartReply(code)
            }
            Word::Reply { exception, has_room } => {
                known.pending = None;
                Input::Reply { exception: if exception { GRIP } else { Exception::None }, has_room }
            }
            Word::Head => Input::Bytes { partial: true },
            Word::Corrupt => Input::Corrupt(ErrorCode::Checksum),
            Word::Begin => Input::Start { has_room: true },
            Word::Finish => Input::Finish,
            Word::Interrupt => Input::Interrupt,
            Word::Return => Input::Return,
        })
    }

    fn cut(&self, known: &mut Known) {
        (known.cut, known.held) = (known.held, false);
    }

    fn next(&self, end: &ControllerMachine, known: &mut Known) -> Option<InputOf<Self>> {
        known.read = core::mem::take(&mut known.cut) && end.phase != ControllerPhase::Disconnected;
        known.read.then_some(Input::Corrupt(ErrorCode::Format))
    }

    fn sent(&self, message: &Outgoing) -> InputOf<Self> {
        Input::Sent { len: Message::from(*message).len() }
    }

    fn acted(&self, _: &ControllerMachine, known: &mut Known, cause: CauseOf<Self>, action: Action) {
        let (in_window, is_over) = self.window(known);
        let is_read = core::mem::take(&mut known.read);
        let mut wrong = None;
        let mut must = |holds: bool, what| {
            if !holds {
                wrong = Some(what);
            }
        };
        match action {
            Action::Begin => {
                must(!known.open, ENDED);
                (known.open, known.attempts, known.window) = (true, 0, Window::Good);
                (known.since_sent, known.interrupted, known.unreported) = (LONG, false, false);
            }
            Action::Sent(message) => {
                must(known.open && is_over, APART);
                must(self.is_next(known, message), REPORTED);
                known.send(message, &mut must);
            }
            Action::Take(taken, handling) => {
                must(in_window && known.is_awaited(), TAKEN);
                must(taken == Taken::Rests || !known.interrupted, UNASKED);
                known.window = Window::Good;
                if let Some(Handling::Subroutine(_)) = handling {
                    must(!known.interrupted, NESTED);
                    (known.interrupted, known.unreported) = (true, true);
                }
            }
            Action::Start(outcome) | Action::BadStart(_, Some(outcome)) => {
                let is_answer = cause != Cause::Due;
                must(!is_answer || in_window && known.is_awaited(), TAKEN);
                if is_answer {
                    known.window = Window::Good;
                }
                match outcome {
                    StartOutcome::Started => {}
                    StartOutcome::Refused => must(core::mem::take(&mut known.open), ENDED),
                    StartOutcome::GaveUp => {
                        must(known.attempts >= self.config.attempts, TRIES);
                        must(core::mem::take(&mut known.open), ENDED);
                    }
                }
            }
            Action::BadStart(_, None) | Action::BadReply(_) | Action::Missing => {
                must(cause == Cause::Due && is_over && !known.closed, TAKEN);
                known.closed = true;
            }
            Action::End(_) => must(core::mem::take(&mut known.open), ENDED),
            // What is missing has ended ALTER before.
            Action::Rest if known.closed && known.window == Window::Nothing => {}
            Action::Rest => known.window = Window::Good,
            // What has begun before the window closes is in it, however late it is given up.
            Action::Nothing => {
                self.note(known, cause, in_window || is_read && is_over && !known.closed, is_read)
            }
            Action::Refuse(_) | Action::Stray => {}
        }
        if matches!(cause, Cause::Connected | Cause::Disconnected) {
            (known.held, known.cut) = (false, false);
        }
        known.wrong = known.wrong.or(wrong);
    }

    fn tick(&self, known: &mut Known) {
        known.since_sent = (known.since_sent + 1).min(LONG);
    }

    fn restarted(&self, known: &mut Known) {
        *known = Known { pending: known.pending, wrong: known.wrong, ..self.known() };
    }

    fn broken(&self, end: &ControllerMachine, known: &Known, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
        if matches!(end.phase, ControllerPhase::On(_)) != known.open {
            broken.push(ENDED);
        }
    }

    /// A host that sends nothing more ends every ALTER.
    fn is_over(&self, _: &ControllerMachine, known: &Known) -> bool {
        !known.open
    }
}

impl AnyHost {
    /// Whether an answer that comes now can be one to the last message, and whether its window is over.
    fn window(&self, known: &Known) -> (bool, bool) {
        let (mode, baud) = (self.config.mode.accumulation(), self.config.baud);
        let budget = Budget::new(mode, baud, known.len.into(), 0);
        let since = u32::from(known.since_sent) * TICK;
        let is_over = since >= budget.request + budget.window;
        (since >= budget.request && !is_over, is_over)
    }

    /// Whether a message says what the window before has brought.
    fn is_next(&self, known: &Known, message: Outgoing) -> bool {
        let found = match known.window {
            Window::Nothing => ErrorCode::Timeout,
            Window::Good => ErrorCode::None,
            Window::Fault(code) => code,
        };
        match message {
            Outgoing::Start(error) | Outgoing::End(error) => error == found,
            Outgoing::Motion(_, error) => error == found && known.window != Window::Nothing,
        }
    }

    /// What did nothing else.
    fn note(&self, known: &mut Known, cause: CauseOf<Self>, in_window: bool, is_read: bool) {
        let fault = match cause {
            Cause::Word(Word::Corrupt) => ErrorCode::Checksum,
            Cause::Due if is_read => ErrorCode::Format,
            Cause::Word(Word::Start(StartCode::Repeat)) if known.starts() && in_window => {
                known.window = Window::Good;
                return;
            }
            Cause::Word(Word::Start(_)) => ErrorCode::Format,
            Cause::Word(Word::Reply { .. }) if known.starts() => ErrorCode::Format,
            Cause::Word(Word::Reply { .. }) => ErrorCode::Overflow,
            Cause::Word(Word::Interrupt) => {
                (known.interrupted, known.unreported) = (true, true);
                return;
            }
            Cause::Word(Word::Return) => {
                known.interrupted = false;
                return;
            }
            _ => return,
        };
        if in_window && known.window == Window::Nothing {
            known.window = Window::Fault(fault);
        }
    }
}

impl Known {
    /// No answer to the last message was taken.
    fn is_awaited(&self) -> bool {
        self.window != Window::Good
    }

    /// The last message was a start message.
    fn starts(&self) -> bool {
        self.attempts > 0
    }

    fn send(&mut self, message: Outgoing, must: &mut impl FnMut(bool, &'static str)) {
        (self.pending, self.window, self.since_sent) = (Some(message), Window::Nothing, 0);
        (self.len, self.held, self.closed) = (Message::from(message).len(), false, false);
        match message {
            Outgoing::Start(_) => self.attempts += 1,
            Outgoing::Motion(MotionPhase::Running, _) => must(!self.unreported, INFORMED),
            Outgoing::Motion(MotionPhase::Interrupted, _) => self.unreported = false,
            Outgoing::End(_) => self.open = false,
        }
        if !matches!(message, Outgoing::Start(_)) {
            self.attempts = 0;
        }
    }
}
