//! A controller against hosts of other makers.

use core::time::Duration;

use laser_eb90::controller::machine::{Action, Answer, ControllerMachine, Fault, Input, Receiving, Work};
use laser_eb90::{ControllerConfig, Refusal};
use robot_session::end::Machine as _;

use super::pieces::Piece::{Bad, Begun, FalseHead, Inner, Middle, Noise, Rest, Whole};
use super::pieces::{EMPTY_HEAD, Held, INNER_FRAME, PIECES, Piece, SHAPES, Verdict, spell};
use super::{CUT, SWITCH};
use crate::model::{By, Cause, CauseOf, EXPECTED, Peer, Terms, WRITTEN};

pub(super) const ONE_ANSWER: &str = "one answer at most to each transmission";
pub(super) const ONCE: &str = "executed once, however often it is sent";
pub(super) const HEARD: &str = "a frame whose head has come is answered";
pub(super) const DONE: &str = "echoed: executed";
pub(super) const WHOLE: &str = "echoed: all of it is executed";
pub(super) const INNER: &str = "nothing is executed out of the middle of corrupt bytes";
const ASKED: &str = "nothing is sent before bytes have come";

pub(super) const RULES: Terms = Terms {
    keeps: "LE-45, LE-67, a frame again for each error code",
    free: "when it sends and reads, where its port pauses and for how long, one fault of the line in each transmission",
    shows: &[("LE-5", ONE_ANSWER), ("LE-25", WRITTEN), ("LE-102", DONE), ("LE-103", WRITTEN)],
    properties: &[ONE_ANSWER, ONCE, HEARD, DONE, WHOLE, INNER, EXPECTED],
};
pub(super) const ANYTHING: Terms =
    Terms { keeps: "", free: "any bytes at any time", shows: &[], properties: &[INNER, ASKED, EXPECTED] };

/// A host of which only this is known.
#[derive(Debug, Clone, Copy)]
pub struct AnyHost {
    /// The controller's configuration.
    pub config: ControllerConfig,
    /// It sends a frame, and the next one after its echo. For each error code it sends the frame again, as the article has it.
    pub keeps_rules: bool,
    /// The controller refuses an immediate instruction that has others after it in its frame.
    pub refuses_mixed: bool,
}

/// The model's knowledge of the host, its line and its frame.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Known {
    /// The contents of the controller's decoder.
    pub(super) held: Held,
    /// The decoder's results that the controller has not read.
    found: Vec<Found>,
    /// The controller reads.
    reading: bool,
    /// Bytes have come, and nothing was sent since.
    has_come: bool,
    /// The bytes that the host's port has not sent.
    pub(super) port: Vec<Piece>,
    host: Host,
    /// An answer that the host has not read.
    answer: Option<Answer>,
    /// The number of times that the frame was executed, or queued.
    executed: u8,
    /// A part of it was not.
    swallowed: bool,
    wrong: Option<&'static str>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Host {
    /// The host has a frame that was never sent.
    Fresh,
    /// The host sends its frame again.
    Again,
    /// The host waits for the answer. `must`: the head has come.
    Waits { is_answered: bool, must: bool },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Found {
    Frame(Verdict),
    /// A frame out of the middle of another one.
    Inner,
    Corrupt {
        refusal: Refusal,
        bytes: u8,
        begun: bool,
    },
}

/// A step of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Word {
    /// The host writes one of the transmissions to its port.
    Transmit(usize),
    /// The next of its pieces arrives.
    Arrive,
    /// These bytes arrive.
    Piece(Piece),
    /// The host reads the answer.
    Read,
    /// The host, or its operator, stops waiting.
    GiveUp,
    /// The instruction is executed, or it fails.
    Executed(bool),
}

impl Peer for AnyHost {
    type End = ControllerMachine;
    type Known = Known;
    type Word = Word;

    const TICK: Duration = Duration::from_millis(25);

    fn config(&self) -> &ControllerConfig {
        &self.config
    }

    fn end(&self) -> ControllerMachine {
        ControllerMachine::NEW
    }

    fn known(&self) -> Known {
        Known {
            held: Held::Nothing,
            found: Vec::new(),
            reading: false,
            has_come: false,
            port: Vec::new(),
            host: Host::Fresh,
            answer: None,
            executed: 0,
            swallowed: false,
            wrong: None,
        }
    }

    fn words(&self, end: &ControllerMachine, known: &Known, words: &mut Vec<Word>) {
        if !end.reads() {
            words.push(Word::Executed(true));
        }
        if !self.keeps_rules {
            if !end.reads() {
                words.push(Word::Executed(false));
            }
            if end.is_connected() && known.found.len() < 2 {
                let fits = |piece: &Piece| known.held.goes_on_with(*piece);
                words.extend(PIECES.iter().copied().filter(fits).map(Word::Piece));
            }
            return;
        }
        if end.is_connected() && !known.port.is_empty() {
            words.push(Word::Arrive);
        }
        if known.answer.is_some() {
            words.push(Word::Read);
        }
        match known.host {
            Host::Fresh | Host::Again => words.extend((0..SHAPES.len()).map(Word::Transmit)),
            Host::Waits { is_answered: false, .. } if known.is_quiet(end) => words.push(Word::GiveUp),
            Host::Waits { .. } => {}
        }
    }

    fn by(&self, word: Word) -> By {
        match word {
            Word::Arrive | Word::Piece(_) => By::Line,
            Word::Executed(_) => By::User,
            Word::Transmit(_) | Word::Read | Word::GiveUp => By::Others,
        }
    }

    /// Bytes are taken even while an instruction is executed.
    fn takes(&self, _: &ControllerMachine) -> bool {
        true
    }

    fn hear(&self, _: &ControllerMachine, known: &mut Known, word: Word) -> Option<Input> {
        match word {
            Word::Transmit(shape) => {
                let (pieces, must) = SHAPES[shape];
                known.port.extend(pieces);
                known.host = Host::Waits { is_answered: false, must };
                None
            }
            Word::Arrive => {
                let piece = known.port.remove(0);
                Some(known.hear(piece))
            }
            Word::Piece(piece) => Some(known.hear(piece)),
            Word::Read => {
                match known.answer.take() {
                    Some(Answer::Error(_)) => known.host = Host::Again,
                    _ => {
                        if known.executed == 0 {
                            known.wrong = Some(DONE);
                        }
                        if known.swallowed {
                            known.wrong = Some(WHOLE);
                        }
                        known.begin();
                    }
                }
                None
            }
            Word::GiveUp => {
                known.begin();
                None
            }
            Word::Executed(good) => {
                known.reading = true;
                Some(Input::Executed(if good { Ok(()) } else { Err(Refusal::BadParameters) }))
            }
        }
    }

    fn cut(&self, known: &mut Known) {
        let begun = matches!(known.held, Held::Begun(_));
        known.give_up(Refusal::BadFrame, begun);
    }

    fn next(&self, end: &ControllerMachine, known: &mut Known) -> Option<Input> {
        if !known.found.is_empty() && end.reads() {
            return Some(match known.found.remove(0) {
                Found::Corrupt { refusal, bytes, begun } => Input::Corrupt { refusal, bytes, begun },
                Found::Frame(_) | Found::Inner if !end.trusts(&self.config) => Input::Untrusted,
                Found::Frame(Verdict::Full) => Input::Refused(Refusal::QueueFull),
                Found::Frame(Verdict::Mixed) if self.refuses_mixed => Input::Refused(Refusal::BadBatch),
                Found::Frame(Verdict::Queued) => {
                    known.execute();
                    Input::Queued { word: CUT }
                }
                Found::Frame(verdict @ (Verdict::Immediate | Verdict::Mixed)) => {
                    known.execute();
                    known.swallowed |= verdict == Verdict::Mixed;
                    Input::Immediate { word: SWITCH }
                }
                Found::Inner => {
                    known.wrong = Some(INNER);
                    Input::Queued { word: CUT }
                }
            });
        }
        let partial = known.held != Held::Nothing || !known.found.is_empty();
        core::mem::take(&mut known.reading).then_some(Input::Read { partial })
    }

    fn sent(&self, _: &Answer) -> Input {
        Input::Sent
    }

    fn acted(&self, _: &ControllerMachine, known: &mut Known, cause: CauseOf<Self>, _: Action) {
        match cause {
            Cause::Connected | Cause::Disconnected => self.restarted(known),
            Cause::Sent(answer) => {
                if !core::mem::take(&mut known.has_come) {
                    known.wrong = Some(ASKED);
                }
                if !self.keeps_rules {
                    return;
                }
                match &mut known.host {
                    Host::Waits { is_answered, .. } if !*is_answered => *is_answered = true,
                    _ => known.wrong = Some(ONE_ANSWER),
                }
                known.answer = Some(answer);
            }
            Cause::Due | Cause::Word(_) => {}
        }
    }

    fn restarted(&self, known: &mut Known) {
        (known.held, known.reading) = (Held::Nothing, false);
        known.found.clear();
    }

    fn broken(&self, end: &ControllerMachine, known: &Known, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
        if known.executed > 1 && self.keeps_rules {
            broken.push(ONCE);
        }
        let unheard = known.host == Host::Waits { is_answered: false, must: true };
        if unheard && known.is_quiet(end) {
            broken.push(HEARD);
        }
    }

    fn is_over(&self, _: &ControllerMachine, known: &Known) -> bool {
        known.host == Host::Fresh
    }

    fn benign(&self, end: &ControllerMachine, known: &Known) -> Option<Word> {
        let mut words = Vec::new();
        self.words(end, known, &mut words);
        words.first().copied()
    }
}

impl Known {
    /// Called when bytes come; returns the input.
    fn hear(&mut self, piece: Piece) -> Input {
        (self.reading, self.has_come) = (true, true);
        let bytes = spell(piece, self.held).len() as u8;
        let held = self.held;
        match piece {
            Whole(verdict) => {
                self.meet();
                self.found.push(Found::Frame(verdict));
            }
            Bad => {
                self.meet();
                self.corrupt(Refusal::BadChecksum, bytes, true);
            }
            Inner { headless } => {
                if !headless {
                    self.meet();
                }
                let begun = !headless || matches!(held, Held::Begun(_));
                let refusal = if begun { Refusal::BadChecksum } else { Refusal::BadFrame };
                let before = core::mem::replace(&mut self.held, Held::Nothing).bytes();
                self.corrupt(refusal, before + bytes - INNER_FRAME, begun);
                self.found.push(Found::Inner);
            }
            Begun(_) => {
                self.meet();
                self.held = Held::Begun(bytes);
            }
            Rest { .. } | FalseHead if matches!(held, Held::Begun(_)) => {
                self.held = Held::Nothing;
                self.found.push(Found::Frame(Verdict::Queued));
            }
            FalseHead => {
                self.corrupt(Refusal::BadFrame, held.bytes() + bytes - EMPTY_HEAD, false);
                self.held = Held::Begun(EMPTY_HEAD);
            }
            // Its first byte is not a tag.
            Noise { .. } if matches!(held, Held::Begun(_)) => {
                self.corrupt(Refusal::BadFrame, held.bytes() + 1, false);
                self.held = Held::Headless(bytes - 1);
            }
            Middle { .. } | Noise { .. } | Rest { .. } => self.held = held.and(bytes),
        }
        Input::Bytes
    }

    /// A head comes after the held bytes: it is a tail and a check of a frame that has begun, or no tag of it.
    fn meet(&mut self) {
        match self.held {
            Held::Nothing | Held::Headless(_) | Held::Begun(EMPTY_HEAD) => {
                self.give_up(Refusal::BadFrame, false)
            }
            Held::Begun(_) => self.give_up(Refusal::BadChecksum, true),
        }
    }

    /// Reports the decoder's bytes as corrupt.
    fn give_up(&mut self, refusal: Refusal, begun: bool) {
        let held = core::mem::replace(&mut self.held, Held::Nothing);
        if held != Held::Nothing {
            self.corrupt(refusal, held.bytes(), begun);
        }
    }

    fn corrupt(&mut self, refusal: Refusal, bytes: u8, begun: bool) {
        let bytes = bytes.min(Fault::ENOUGH);
        self.found.push(Found::Corrupt { refusal, bytes, begun });
    }

    /// The host has another frame.
    fn begin(&mut self) {
        (self.host, self.executed, self.swallowed) = (Host::Fresh, 0, false);
    }

    fn execute(&mut self) {
        self.executed = (self.executed + 1).min(2);
    }

    /// Returns whether the sent messages can have no further effect.
    fn is_quiet(&self, end: &ControllerMachine) -> bool {
        self.port.is_empty() && end.line == Receiving::Silent && matches!(end.work, Work::Listening { .. })
    }
}
