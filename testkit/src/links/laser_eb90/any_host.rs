//! A controller against hosts of other makers.

use core::time::Duration;

use laser_eb90::controller::machine::{Action, Answer, ControllerMachine, Input, Receiving, Work};
use laser_eb90::{ControllerConfig, Refusal};
use robot_session::end::Machine as _;

use super::world::CUT;
use crate::model::{By, Cause, CauseOf, EXPECTED, Peer, Terms};

/// As many bytes as the shortest frame has and more, and fewer.
const MANY: u8 = 20;
const FEW: u8 = 4;

pub(super) const ONE_ANSWER: &str = "one answer at most to each transmission";
pub(super) const ONCE: &str = "executed once, however often it is sent";
pub(super) const HEARD: &str = "a frame whose head has come is answered";
pub(super) const DONE: &str = "echoed: executed";
pub(super) const INNER: &str = "nothing is executed out of the middle of corrupt bytes";
const ASKED: &str = "nothing is sent before bytes have come";

pub(super) const RULES: Terms = Terms {
    keeps: "LE-45, LE-67; it sends a frame again for each error code",
    free: "when it sends and reads, where its port pauses and for how long, one fault of the line in each transmission",
    shows: &[],
    properties: &[ONE_ANSWER, ONCE, HEARD, DONE, INNER, EXPECTED],
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
}

/// The model's knowledge of the host, its line and its frame.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Known {
    /// The contents of the controller's decoder.
    held: Held,
    /// The decoder's results that the controller has not read.
    found: Vec<Found>,
    /// The controller reads.
    reading: bool,
    /// Bytes have come, and nothing was sent since.
    has_come: bool,
    /// The bytes that the host's port has not sent.
    port: Vec<Piece>,
    host: Host,
    /// An answer that the host has not read.
    answer: Option<Answer>,
    /// The number of times that the frame was executed, or queued.
    executed: u8,
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
enum Held {
    Nothing,
    Headless { many: bool },
    Begun { many: bool },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Found {
    Frame(Verdict),
    /// A frame out of the middle of another one.
    Inner,
    Corrupt {
        refusal: Refusal,
        many: bool,
        begun: bool,
    },
}

/// The controller's decision about a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Verdict {
    /// The controller queues it.
    Queued,
    /// The controller's queue is full.
    Full,
    /// The controller executes it.
    Immediate,
}

/// Bytes without a pause between them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Piece {
    /// A good frame.
    Whole(Verdict),
    /// A frame whose check is wrong.
    Bad,
    /// A frame that has lost a byte, so that one is found in its middle; its head may be corrupt, too.
    Inner {
        /// Whether the head is corrupt.
        headless: bool,
    },
    /// The beginning of a frame.
    Begun {
        /// As much as the shortest frame.
        many: bool,
    },
    /// More of it.
    More,
    /// The rest of it.
    Rest {
        /// As much as the shortest frame.
        many: bool,
        /// Whether it ends in EB 90 82: data and tail.
        false_head: bool,
    },
    /// Bytes without a head.
    Headless {
        /// As many as the shortest frame has.
        many: bool,
    },
}

use Piece::{Bad, Begun, Headless, Inner, More, Rest, Whole};

const REST: Piece = Rest { many: true, false_head: false };
const TAIL: Piece = Rest { many: false, false_head: false };
const FALSE: Piece = Rest { many: true, false_head: true };

/// A transmission: pieces between which the port may pause, and whether its head comes.
const SHAPES: &[(&[Piece], bool)] = &[
    (&[Whole(Verdict::Queued)], true),
    (&[Whole(Verdict::Full)], true),
    (&[Whole(Verdict::Immediate)], true),
    (&[Bad], true),
    (&[Inner { headless: false }], true),
    (&[Begun { many: true }, REST], true),
    (&[Begun { many: true }, TAIL], true),
    (&[Begun { many: true }, FALSE], true),
    (&[Begun { many: true }, More, REST], true),
    (&[Begun { many: true }, More, TAIL], true),
    (&[Begun { many: false }, REST], true),
    (&[Begun { many: false }, More, REST], true),
    (&[Begun { many: false }, FALSE], true),
    // It is cut.
    (&[Begun { many: true }], true),
    // A byte of its middle reads as the tail.
    (&[Bad, Headless { many: true }], true),
    // A little noise.
    (&[Headless { many: false }, Whole(Verdict::Queued)], true),
    // Its head is corrupt.
    (&[Headless { many: true }], false),
    (&[Headless { many: true }, Headless { many: true }], false),
    (&[Headless { many: true }, Headless { many: false }], false),
    (&[Headless { many: false }, Headless { many: true }], false),
    (&[Inner { headless: true }], false),
    // It is lost.
    (&[], false),
];

const PIECES: &[Piece] = &[
    Whole(Verdict::Queued),
    Whole(Verdict::Full),
    Whole(Verdict::Immediate),
    Bad,
    Inner { headless: false },
    Inner { headless: true },
    Begun { many: true },
    Begun { many: false },
    More,
    REST,
    FALSE,
    Headless { many: true },
    Headless { many: false },
];

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
                words.extend(PIECES.iter().copied().map(Word::Piece));
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

    /// Returns the actor of a word: bytes are read even while an instruction is executed.
    fn by(&self, word: Word) -> By {
        match word {
            Word::Arrive | Word::Piece(_) | Word::Executed(_) => By::User,
            Word::Transmit(_) | Word::Read | Word::GiveUp => By::Others,
        }
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
                        (known.host, known.executed) = (Host::Fresh, 0);
                    }
                }
                None
            }
            Word::GiveUp => {
                (known.host, known.executed) = (Host::Fresh, 0);
                None
            }
            Word::Executed(good) => {
                known.reading = true;
                Some(Input::Executed(if good { Ok(()) } else { Err(Refusal::BadParameters) }))
            }
        }
    }

    fn cut(&self, known: &mut Known) {
        known.flush();
    }

    fn next(&self, end: &ControllerMachine, known: &mut Known) -> Option<Input> {
        if !known.found.is_empty() && end.reads() {
            return Some(match known.found.remove(0) {
                Found::Corrupt { refusal, many, begun } => {
                    Input::Corrupt { refusal, bytes: if many { MANY } else { FEW }, begun }
                }
                Found::Frame(_) | Found::Inner if !end.trusts(&self.config) => Input::Untrusted,
                Found::Frame(Verdict::Full) => Input::Refused(Refusal::QueueFull),
                Found::Frame(Verdict::Queued) => {
                    known.execute();
                    Input::Queued { word: CUT }
                }
                Found::Frame(Verdict::Immediate) => {
                    known.execute();
                    Input::Immediate { word: CUT }
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
        let has_begun = matches!(self.held, Held::Begun { .. });
        match piece {
            Whole(verdict) => {
                self.flush();
                self.found.push(Found::Frame(verdict));
            }
            Bad => {
                self.flush();
                self.found.push(Found::Corrupt { refusal: Refusal::BadChecksum, many: true, begun: true });
            }
            Inner { headless } => {
                self.flush();
                let refusal = if headless { Refusal::BadFrame } else { Refusal::BadChecksum };
                self.found.push(Found::Corrupt { refusal, many: true, begun: !headless });
                self.found.push(Found::Inner);
            }
            Begun { many } => {
                self.flush();
                self.held = Held::Begun { many };
            }
            More if has_begun => self.held = Held::Begun { many: true },
            Rest { .. } if has_begun => {
                self.held = Held::Nothing;
                self.found.push(Found::Frame(Verdict::Queued));
            }
            More | Rest { many: true, .. } | Headless { many: true } => {
                if !has_begun {
                    self.held = Held::Headless { many: true };
                }
                if matches!(piece, Rest { false_head: true, .. }) {
                    self.flush();
                    self.held = Held::Begun { many: false };
                }
            }
            Rest { many: false, .. } | Headless { many: false } => {
                if self.held == Held::Nothing {
                    self.held = Held::Headless { many: false };
                }
            }
        }
        Input::Bytes
    }

    /// Reports the decoder's bytes as corrupt.
    fn flush(&mut self) {
        let corrupt = |many, begun| Found::Corrupt { refusal: Refusal::BadFrame, many, begun };
        self.found.extend(match core::mem::replace(&mut self.held, Held::Nothing) {
            Held::Nothing => None,
            Held::Headless { many } => Some(corrupt(many, false)),
            Held::Begun { many } => Some(corrupt(many, true)),
        });
    }

    fn execute(&mut self) {
        self.executed = (self.executed + 1).min(2);
    }

    /// Returns whether the sent messages can have no further effect.
    fn is_quiet(&self, end: &ControllerMachine) -> bool {
        self.port.is_empty() && end.line == Receiving::Silent && matches!(end.work, Work::Listening { .. })
    }
}
