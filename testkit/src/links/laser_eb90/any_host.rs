//! A controller against hosts of other makers.

use core::time::Duration;

use laser_eb90::controller::machine::{Action, Answer, ControllerMachine, Fault, Input, LineState, Work};
use laser_eb90::{ControllerConfig, Refusal};
use robot_session::end::Machine as _;

use super::pieces::Piece::{Bad, Begun, FalseHead, Inner, Middle, Noise, Rest, Whole};
use super::pieces::{DecoderContents, EMPTY_HEAD, INNER_FRAME, PIECES, Piece, SHAPES, Verdict, spell};
use super::{CUT, SWITCH};
use crate::model::{Actor, Cause, CauseOf, EXPECTED, Peer, PeerAssumptions, WRITTEN};

pub(super) const ONE_ANSWER: &str = "one answer at most to each transmission";
pub(super) const ONCE: &str = "executed once, however often it is sent";
pub(super) const HEARD: &str = "a frame whose head has come is answered";
pub(super) const DONE: &str = "echoed: executed";
pub(super) const WHOLE: &str = "echoed: all of it is executed";
pub(super) const INNER: &str = "nothing is executed out of the middle of corrupt bytes";
const ASKED: &str = "nothing is sent before bytes have come";

pub(super) const RULES: PeerAssumptions = PeerAssumptions {
    keeps: "LE-45, LE-67, a frame again for each error code",
    free: "when it sends and reads, where its port pauses and for how long, one fault of the line in each transmission",
    shows: &[("LE-5", ONE_ANSWER), ("LE-25", WRITTEN), ("LE-102", DONE), ("LE-103", WRITTEN)],
    properties: &[ONE_ANSWER, ONCE, HEARD, DONE, WHOLE, INNER, EXPECTED],
};
pub(super) const ANYTHING: PeerAssumptions = PeerAssumptions {
    keeps: "",
    free: "any bytes at any time",
    shows: &[],
    properties: &[INNER, ASKED, EXPECTED],
};

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
pub struct Knowledge {
    /// The contents of the controller's decoder.
    pub(super) held: DecoderContents,
    /// The decoder's results that the controller has not read.
    found: Vec<DecoderResult>,
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
enum DecoderResult {
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
pub enum Step {
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
    type Knowledge = Knowledge;
    type Step = Step;

    const TICK: Duration = Duration::from_millis(25);

    fn config(&self) -> &ControllerConfig {
        &self.config
    }

    fn end(&self) -> ControllerMachine {
        ControllerMachine::NEW
    }

    fn known(&self) -> Knowledge {
        Knowledge {
            held: DecoderContents::Nothing,
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

    fn steps(&self, end: &ControllerMachine, known: &Knowledge, steps: &mut Vec<Step>) {
        if !end.reads() {
            steps.push(Step::Executed(true));
        }
        if !self.keeps_rules {
            if !end.reads() {
                steps.push(Step::Executed(false));
            }
            if end.is_connected() && known.found.len() < 2 {
                let fits = |piece: &Piece| known.held.goes_on_with(*piece);
                steps.extend(PIECES.iter().copied().filter(fits).map(Step::Piece));
            }
            return;
        }
        if end.is_connected() && !known.port.is_empty() {
            steps.push(Step::Arrive);
        }
        if known.answer.is_some() {
            steps.push(Step::Read);
        }
        match known.host {
            Host::Fresh | Host::Again => steps.extend((0..SHAPES.len()).map(Step::Transmit)),
            Host::Waits { is_answered: false, .. } if known.is_quiet(end) => steps.push(Step::GiveUp),
            Host::Waits { .. } => {}
        }
    }

    fn by(&self, word: Step) -> Actor {
        match word {
            Step::Arrive | Step::Piece(_) => Actor::Line,
            Step::Executed(_) => Actor::User,
            Step::Transmit(_) | Step::Read | Step::GiveUp => Actor::Others,
        }
    }

    /// Bytes are taken even while an instruction is executed.
    fn takes(&self, _: &ControllerMachine) -> bool {
        true
    }

    fn apply(&self, _: &ControllerMachine, known: &mut Knowledge, word: Step) -> Option<Input> {
        match word {
            Step::Transmit(shape) => {
                let (pieces, must) = SHAPES[shape];
                known.port.extend(pieces);
                known.host = Host::Waits { is_answered: false, must };
                None
            }
            Step::Arrive => {
                let piece = known.port.remove(0);
                Some(known.receive(piece))
            }
            Step::Piece(piece) => Some(known.receive(piece)),
            Step::Read => {
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
            Step::GiveUp => {
                known.begin();
                None
            }
            Step::Executed(good) => {
                known.reading = true;
                Some(Input::Executed(if good { Ok(()) } else { Err(Refusal::BadParameters) }))
            }
        }
    }

    fn cut(&self, known: &mut Knowledge) {
        let begun = matches!(known.held, DecoderContents::Begun(_));
        known.give_up(Refusal::BadFrame, begun);
    }

    fn next(&self, end: &ControllerMachine, known: &mut Knowledge) -> Option<Input> {
        if !known.found.is_empty() && end.reads() {
            return Some(match known.found.remove(0) {
                DecoderResult::Corrupt { refusal, bytes, begun } => Input::Corrupt { refusal, bytes, begun },
                DecoderResult::Frame(_) | DecoderResult::Inner if !end.trusts(&self.config) => {
                    Input::Untrusted
                }
                DecoderResult::Frame(Verdict::Full) => Input::Refused(Refusal::QueueFull),
                DecoderResult::Frame(Verdict::Mixed) if self.refuses_mixed => {
                    Input::Refused(Refusal::BadBatch)
                }
                DecoderResult::Frame(Verdict::Queued) => {
                    known.execute();
                    Input::Queued { word: CUT }
                }
                DecoderResult::Frame(verdict @ (Verdict::Immediate | Verdict::Mixed)) => {
                    known.execute();
                    known.swallowed |= verdict == Verdict::Mixed;
                    Input::Immediate { word: SWITCH }
                }
                DecoderResult::Inner => {
                    known.wrong = Some(INNER);
                    Input::Queued { word: CUT }
                }
            });
        }
        let partial = known.held != DecoderContents::Nothing || !known.found.is_empty();
        core::mem::take(&mut known.reading).then_some(Input::Read { partial })
    }

    fn sent(&self, _: &Answer) -> Input {
        Input::Sent
    }

    fn acted(&self, _: &ControllerMachine, known: &mut Knowledge, cause: CauseOf<Self>, _: Action) {
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
            Cause::Due | Cause::Step(_) => {}
        }
    }

    fn restarted(&self, known: &mut Knowledge) {
        (known.held, known.reading) = (DecoderContents::Nothing, false);
        known.found.clear();
    }

    fn broken(&self, end: &ControllerMachine, known: &Knowledge, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
        if known.executed > 1 && self.keeps_rules {
            broken.push(ONCE);
        }
        let unheard = known.host == Host::Waits { is_answered: false, must: true };
        if unheard && known.is_quiet(end) {
            broken.push(HEARD);
        }
    }

    fn is_over(&self, _: &ControllerMachine, known: &Knowledge) -> bool {
        known.host == Host::Fresh
    }

    fn fault_free_step(&self, end: &ControllerMachine, known: &Knowledge) -> Option<Step> {
        let mut steps = Vec::new();
        self.steps(end, known, &mut steps);
        steps.first().copied()
    }
}

impl Knowledge {
    /// Called when bytes come; returns the input.
    fn receive(&mut self, piece: Piece) -> Input {
        (self.reading, self.has_come) = (true, true);
        let bytes = spell(piece, self.held).len() as u8;
        let held = self.held;
        match piece {
            Whole(verdict) => {
                self.meet();
                self.found.push(DecoderResult::Frame(verdict));
            }
            Bad => {
                self.meet();
                self.corrupt(Refusal::BadChecksum, bytes, true);
            }
            Inner { headless } => {
                if !headless {
                    self.meet();
                }
                let begun = !headless || matches!(held, DecoderContents::Begun(_));
                let refusal = if begun { Refusal::BadChecksum } else { Refusal::BadFrame };
                let before = core::mem::replace(&mut self.held, DecoderContents::Nothing).bytes();
                self.corrupt(refusal, before + bytes - INNER_FRAME, begun);
                self.found.push(DecoderResult::Inner);
            }
            Begun(_) => {
                self.meet();
                self.held = DecoderContents::Begun(bytes);
            }
            Rest { .. } | FalseHead if matches!(held, DecoderContents::Begun(_)) => {
                self.held = DecoderContents::Nothing;
                self.found.push(DecoderResult::Frame(Verdict::Queued));
            }
            FalseHead => {
                self.corrupt(Refusal::BadFrame, held.bytes() + bytes - EMPTY_HEAD, false);
                self.held = DecoderContents::Begun(EMPTY_HEAD);
            }
            // The first byte of noise is not a tag.
            Noise { .. } if matches!(held, DecoderContents::Begun(_)) => {
                self.corrupt(Refusal::BadFrame, held.bytes() + 1, false);
                self.held = DecoderContents::Headless(bytes - 1);
            }
            Middle { .. } | Noise { .. } | Rest { .. } => self.held = held.and(bytes),
        }
        Input::Bytes
    }

    /// A head comes after the held bytes: it is a tail and a check of a frame that has begun, or no tag of it.
    fn meet(&mut self) {
        match self.held {
            DecoderContents::Nothing | DecoderContents::Headless(_) | DecoderContents::Begun(EMPTY_HEAD) => {
                self.give_up(Refusal::BadFrame, false)
            }
            DecoderContents::Begun(_) => self.give_up(Refusal::BadChecksum, true),
        }
    }

    /// Reports the decoder's bytes as corrupt.
    fn give_up(&mut self, refusal: Refusal, begun: bool) {
        let held = core::mem::replace(&mut self.held, DecoderContents::Nothing);
        if held != DecoderContents::Nothing {
            self.corrupt(refusal, held.bytes(), begun);
        }
    }

    fn corrupt(&mut self, refusal: Refusal, bytes: u8, begun: bool) {
        let bytes = bytes.min(Fault::MIN_BYTES);
        self.found.push(DecoderResult::Corrupt { refusal, bytes, begun });
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
        self.port.is_empty() && end.line == LineState::Silent && matches!(end.work, Work::Listening { .. })
    }
}
