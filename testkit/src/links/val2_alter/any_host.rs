//! A controller against hosts of other makers.

use core::time::Duration;

use val2_alter::controller::machine::{
    Action, ControllerMachine, ControllerPhase, DueMessage, ExceptionHandling, Input, ReplyEffect,
    StartOutcome,
};
use val2_alter::timing::Budget;
use val2_alter::{ControllerConfig, ErrorCode, Exception, Framing, Message as _, MotionPhase, StartCode};

use super::world::{DecoderContents, GRIP, INFORMED, NESTED, TICK, TRIES, UNASKED, message};
use crate::model::{Actor, Cause, CauseOf, EXPECTED, InputOf, Peer, PeerAssumptions, STANDSTILL};

/// Ticks after which every window has closed.
const LONG: u8 = 5;

pub(super) const TAKEN: &str = "one answer to a message is taken at most, in its window";
pub(super) const REPORTED: &str = "a message has the error of the window before, and no reply ends ALTER";
pub(super) const APART: &str = "a message is sent when the window of the one before is over, and in an ALTER";
pub(super) const ENDED: &str = "each ALTER has one end";
pub(super) const TURN: &str = "the program interrupts ALTER only while no reply is awaited";

const PROPERTIES: &[&str] =
    &[TAKEN, REPORTED, APART, ENDED, TURN, NESTED, INFORMED, UNASKED, TRIES, STANDSTILL, EXPECTED];
pub(super) const RULES: PeerAssumptions = PeerAssumptions {
    keeps: "AL-53, AL-54, AL-67",
    free: "whether and when it answers and what, what is lost, corrupt, in pieces or late",
    shows: &[],
    properties: PROPERTIES,
};
pub(super) const ANYTHING: PeerAssumptions = PeerAssumptions {
    keeps: "",
    free: "any message, whole, in part or corrupt, and noise at any time",
    shows: &[
        ("AL-71", APART),
        ("AL-72", APART),
        ("AL-73", APART),
        ("AL-75", TRIES),
        ("AL-76", REPORTED),
        ("AL-77", TAKEN),
        ("AL-78", NESTED),
        ("AL-79", INFORMED),
        ("AL-90", TURN),
    ],
    properties: PROPERTIES,
};
/// The same without free space to report an exception.
pub(super) const FULL: PeerAssumptions = PeerAssumptions { shows: &[], ..ANYTHING };

/// A host of which only this is known.
#[derive(Debug, Clone, Copy)]
pub struct AnyHost {
    /// The controller's configuration.
    pub config: ControllerConfig,
    /// It answers a message at most once and by its kind (AL-53, AL-54), without an exception in an interruption
    /// (AL-67). The time of the answer is left open.
    pub keeps_rules: bool,
    /// Whether there is free space to report an exception.
    pub has_room: bool,
}

/// The model's knowledge of the line and the program.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Knowledge {
    /// The message that the host may answer.
    pending: Option<DueMessage>,
    /// The contents of the decoder, the other effects of the read bytes on the controller, and the bytes read just now.
    pub(super) held: DecoderContents,
    inputs: Vec<Input>,
    read: Option<Input>,
    /// An ALTER has no end.
    open: bool,
    /// Start messages sent in it.
    attempts: u8,
    /// The result of the last message's window.
    window: Window,
    /// The window was found closed.
    closed: bool,
    /// Ticks since that message, and its length.
    since_sent: u8,
    len: u8,
    /// Whether the subroutine runs, and whether no message has reported it.
    interrupted: bool,
    unreported: bool,
    wrong: Option<&'static str>,
}

/// The result of a message's window.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Window {
    Nothing,
    Good,
    Fault(ErrorCode),
}

/// A step of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// An answer to a start message comes.
    Start(StartCode),
    /// A reply comes.
    Reply {
        /// With an exception.
        exception: bool,
    },
    /// The start mark of a frame comes. The next answer is the rest of the frame.
    Head,
    /// A corrupt frame comes.
    Corrupt,
    /// Bytes come outside of any frame.
    Noise,
    /// The program executes its ALTER instruction.
    Begin,
    /// The program ends ALTER.
    Finish,
    /// The program runs a subroutine by itself.
    Interrupt,
    /// The subroutine returns.
    Return,
}

const STARTS: [Step; 3] =
    [Step::Start(StartCode::Accept), Step::Start(StartCode::Repeat), Step::Start(StartCode::Refuse)];
impl Peer for AnyHost {
    type End = ControllerMachine;
    type Knowledge = Knowledge;
    type Step = Step;

    const TICK: Duration = TICK;

    fn config(&self) -> &ControllerConfig {
        &self.config
    }

    fn end(&self) -> ControllerMachine {
        ControllerMachine::NEW
    }

    fn known(&self) -> Knowledge {
        Knowledge {
            pending: None,
            held: DecoderContents::Nothing,
            inputs: Vec::new(),
            read: None,
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

    fn steps(&self, end: &ControllerMachine, known: &Knowledge, steps: &mut Vec<Step>) {
        steps.extend([Step::Begin, Step::Finish, Step::Interrupt, Step::Return]);
        if end.phase == ControllerPhase::Disconnected {
            return;
        }
        steps.push(Step::Corrupt);
        if known.held != DecoderContents::Head {
            steps.extend([Step::Head, Step::Noise]);
        }
        let (starts, replies, exceptions) = match known.pending {
            _ if !self.keeps_rules => (true, true, true),
            Some(DueMessage::Start(_)) => (true, false, false),
            Some(DueMessage::Motion(phase, _)) => (false, true, phase == MotionPhase::Running),
            Some(DueMessage::End(_)) | None => (false, false, false),
        };
        if starts {
            steps.extend(STARTS);
        }
        if replies {
            steps.push(Step::Reply { exception: false });
        }
        if exceptions {
            steps.push(Step::Reply { exception: true });
        }
    }

    fn by(&self, step: Step) -> Actor {
        match step {
            Step::Start(_) | Step::Reply { .. } | Step::Head | Step::Corrupt | Step::Noise => Actor::Line,
            Step::Begin | Step::Finish | Step::Interrupt | Step::Return => Actor::User,
        }
    }

    fn apply(&self, _: &ControllerMachine, known: &mut Knowledge, step: Step) -> Option<InputOf<Self>> {
        // When a frame begins, the bytes before it are read.
        if known.held == DecoderContents::Noise && self.by(step) == Actor::Line && step != Step::Noise {
            known.inputs.push(Input::Corrupt(ErrorCode::Mark));
        }
        match step {
            Step::Start(code) => {
                known.pending = None;
                known.hold(Some(Input::StartReply(code)), DecoderContents::Nothing);
            }
            Step::Reply { exception } => {
                known.pending = None;
                let exception = if exception { GRIP } else { Exception::None };
                known.hold(
                    Some(Input::Reply { exception, has_room: self.has_room }),
                    DecoderContents::Nothing,
                );
            }
            Step::Corrupt => known.hold(Some(Input::Corrupt(ErrorCode::Checksum)), DecoderContents::Corrupt),
            Step::Head => known.hold(None, DecoderContents::Head),
            Step::Noise => known.hold(None, known.held.with_noise()),
            Step::Begin => known.inputs.push(Input::Start { has_room: true }),
            Step::Finish => known.inputs.push(Input::Finish),
            Step::Interrupt => known.inputs.push(Input::Interrupt),
            Step::Return => known.inputs.push(Input::Return),
        }
        known.next_input()
    }

    fn cut(&self, known: &mut Knowledge) {
        known.inputs.extend(match core::mem::replace(&mut known.held, DecoderContents::Nothing) {
            DecoderContents::Noise => Some(Input::Corrupt(ErrorCode::Mark)),
            DecoderContents::Head => Some(Input::Corrupt(ErrorCode::Incomplete)),
            DecoderContents::Nothing | DecoderContents::Corrupt => None,
        });
    }

    fn next(&self, _: &ControllerMachine, known: &mut Knowledge) -> Option<InputOf<Self>> {
        known.next_input()
    }

    fn sent(&self, message: &DueMessage) -> InputOf<Self> {
        Input::Sent { len: self.length(*message) }
    }

    fn acted(&self, _: &ControllerMachine, known: &mut Knowledge, cause: CauseOf<Self>, action: Action) {
        let (in_window, is_over) = self.window(known);
        let read = known.read.take();
        let is_read = cause == Cause::Due && matches!(read, Some(Input::Corrupt(_)));
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
                known.send(message, self.length(message), &mut must);
            }
            Action::Take(taken, handling) => {
                must(in_window && known.is_awaited(), TAKEN);
                must(taken == ReplyEffect::Rests || !known.interrupted, UNASKED);
                known.window = Window::Good;
                if let Some(ExceptionHandling::Subroutine(_)) = handling {
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
            // A missing reply has ended ALTER before.
            Action::Rest if known.closed && known.window == Window::Nothing => {}
            Action::Rest => known.window = Window::Good,
            // A frame that has begun before the window closes is in the window, however late it is given up.
            Action::Nothing => {
                if read == Some(Input::Interrupt) {
                    must(known.window == Window::Good || known.closed, TURN);
                }
                known.note(read, in_window || is_read && is_over && !known.closed);
            }
            Action::Refuse(_) | Action::Stray => {}
        }
        if matches!(cause, Cause::Connected | Cause::Disconnected | Cause::Sent(_)) {
            known.held = DecoderContents::Nothing;
        }
        known.wrong = known.wrong.or(wrong);
    }

    fn tick(&self, known: &mut Knowledge) {
        known.since_sent = (known.since_sent + 1).min(LONG);
    }

    fn restarted(&self, known: &mut Knowledge) {
        *known = Knowledge { pending: known.pending, wrong: known.wrong, ..self.known() };
    }

    fn broken(&self, end: &ControllerMachine, known: &Knowledge, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
        if matches!(end.phase, ControllerPhase::On(_)) != known.open {
            broken.push(ENDED);
        }
    }

    /// Returns whether ALTER is over, as it must be in the end after a host has stopped sending.
    fn is_over(&self, _: &ControllerMachine, known: &Knowledge) -> bool {
        !known.open
    }
}

impl AnyHost {
    /// Returns whether an answer that comes now can belong to the last message, and whether its window is over.
    fn window(&self, known: &Knowledge) -> (bool, bool) {
        let (mode, baud) = (self.config.mode.accumulation(), self.config.baud);
        let budget = Budget::new(mode, baud, known.len.into(), 0);
        let since = u32::from(known.since_sent) * TICK;
        let is_over = since >= budget.request + budget.window;
        (since >= budget.request && !is_over, is_over)
    }

    /// Returns whether a message reports the result of the previous window.
    fn is_next(&self, known: &Knowledge, message: DueMessage) -> bool {
        let found = match known.window {
            Window::Nothing => ErrorCode::Timeout,
            Window::Good => ErrorCode::None,
            Window::Fault(code) => code,
        };
        match message {
            DueMessage::Start(error) | DueMessage::End(error) => error == found,
            DueMessage::Motion(_, error) => error == found && known.window != Window::Nothing,
        }
    }

    fn length(&self, what: DueMessage) -> u8 {
        message(what, self.config.mode).encoded_len(Framing::DEFAULT) as u8
    }
}

impl Knowledge {
    /// Returns whether the last message is still unanswered.
    fn is_awaited(&self) -> bool {
        self.window != Window::Good
    }

    /// Returns whether the last message was a start message.
    fn starts(&self) -> bool {
        self.attempts > 0
    }

    /// Appends the inputs of a word: `input`, and its bytes.
    fn hold(&mut self, input: Option<Input>, held: DecoderContents) {
        self.inputs.extend(input);
        self.inputs.push(Input::Bytes { partial: held != DecoderContents::Nothing });
        self.held = held;
    }

    fn next_input(&mut self) -> Option<Input> {
        self.read = (!self.inputs.is_empty()).then(|| self.inputs.remove(0));
        self.read
    }

    /// Records the fault of an input that has no other effect.
    fn note(&mut self, read: Option<Input>, in_window: bool) {
        let fault = match read {
            Some(Input::Corrupt(code)) => code,
            Some(Input::StartReply(StartCode::Repeat)) if self.starts() && in_window => {
                self.window = Window::Good;
                return;
            }
            Some(Input::StartReply(_)) => ErrorCode::Format,
            Some(Input::Reply { .. }) if self.starts() => ErrorCode::Format,
            Some(Input::Reply { .. }) => ErrorCode::Overflow,
            Some(Input::Interrupt) => {
                (self.interrupted, self.unreported) = (true, true);
                return;
            }
            Some(Input::Return) => {
                self.interrupted = false;
                return;
            }
            _ => return,
        };
        if in_window && self.window == Window::Nothing {
            self.window = Window::Fault(fault);
        }
    }

    fn send(&mut self, message: DueMessage, len: u8, must: &mut impl FnMut(bool, &'static str)) {
        (self.pending, self.window, self.since_sent) = (Some(message), Window::Nothing, 0);
        (self.len, self.closed) = (len, false);
        match message {
            DueMessage::Start(_) => self.attempts += 1,
            DueMessage::Motion(MotionPhase::Running, _) => must(!self.unreported, INFORMED),
            DueMessage::Motion(MotionPhase::Interrupted, _) => self.unreported = false,
            DueMessage::End(_) => self.open = false,
        }
        if !matches!(message, DueMessage::Start(_)) {
            self.attempts = 0;
        }
    }
}
