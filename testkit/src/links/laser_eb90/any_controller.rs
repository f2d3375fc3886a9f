//! A host against controllers of other makers.

use core::time::Duration;

use laser_eb90::host::machine::{Action, Batch, DueFrame, HostLink, HostMachine, Input, Outcome};
use laser_eb90::{Class, HostConfig, Refusal};

use super::{CUT, SWITCH};
use crate::model::{Actor, Cause, CauseOf, EXPECTED, Peer, PeerAssumptions, WRITTEN};

const TICK: Duration = Duration::from_millis(50);
/// In ticks: a frame on the line, its pauses, the longest execution, how late an answer comes, and how late an error code.
const LINE: u8 = 1;
const PAUSE: u8 = 1;
const EXECUTION: u8 = 1;
const SETTLE: u8 = 2;
const REPLY: u8 = 1;

pub(super) const DONE: &str = "done: executed";
const DONE_ONCE: &str = "done: executed once";
pub(super) const REFUSED: &str = "refused: not executed";
pub(super) const ONCE: &str = "executed once at most";
pub(super) const ECHOED: &str = "echoed in time: done";
const ONE_OUTCOME: &str = "one outcome for each frame, and one frame at a time";
pub(super) const CLAIMED: &str = "done: its word has come since it was sent";

const SHOWS: &[(&str, &str)] = &[("LE-45", ONE_OUTCOME), ("LE-67", WRITTEN)];
pub(super) const RULES: PeerAssumptions = PeerAssumptions {
    keeps: "LE-5, LE-25, LE-102, LE-103, times of LE-72",
    free: "when it takes a frame, what it refuses, whether it keeps a first half and answers each, what the line loses",
    shows: SHOWS,
    properties: &[DONE, REFUSED, ONCE, ECHOED, ONE_OUTCOME, EXPECTED],
};
/// The same of a host that sends a frame again if no answer comes.
pub(super) const INSISTS: PeerAssumptions =
    PeerAssumptions { properties: &[DONE, DONE_ONCE, REFUSED, ECHOED, ONE_OUTCOME, EXPECTED], ..RULES };
pub(super) const ANYTHING: PeerAssumptions = PeerAssumptions {
    keeps: "",
    free: "any answer at any time",
    shows: SHOWS,
    properties: &[CLAIMED, ECHOED, ONE_OUTCOME, EXPECTED],
};

/// A controller of which only this is known.
#[derive(Debug, Clone, Copy)]
pub struct AnyController {
    /// The host's configuration.
    pub config: HostConfig,
    /// It sends nothing unasked, and its times are those that the host assumes (LE-72).
    pub keeps_rules: bool,
    /// It drops the bytes that it holds of a frame when it answers an error code.
    pub drops: bool,
    /// The driver reports when a frame has left, before it passes on the bytes that came since.
    pub reports: bool,
    /// The real times of the controller and the line.
    pub real: Times,
}

/// The times of a controller and its line, in ticks: a frame's pauses, its execution, an answer, an error code, and
/// the frame of an earlier host on the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Times {
    pub(super) pause: u8,
    pub(super) execution: u8,
    pub(super) settle: u8,
    pub(super) reply: u8,
    pub(super) earlier: u8,
}

impl Times {
    /// The times that the host assumes.
    pub(super) const ASSUMED: Self =
        Self { pause: PAUSE, execution: EXECUTION, settle: SETTLE, reply: REPLY, earlier: LINE };
}

/// The model's knowledge of the controller, the line and the frames.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Knowledge {
    /// Frames on the line and in the controller, the oldest first.
    frames: Vec<Frame>,
    /// Answers, and the ticks before which they come or are lost.
    pub(super) answers: Vec<(Answer, u8)>,
    /// The frame in flight.
    job: Option<Job>,
    /// The ticks until its last byte has left at the latest, if its driver reports that.
    leaves: Option<u8>,
    before: PreviousFrame,
    wrong: Option<&'static str>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Job {
    class: Class,
    /// The number of times.
    executed: u8,
    /// Whether its word has come.
    has_come: bool,
}

/// The frame before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
struct PreviousFrame {
    /// Whether it was reported as refused, or as done after each of its transmissions was answered.
    refused: bool,
    answered: bool,
    /// The number of times.
    executed: u8,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Frame {
    class: Class,
    /// Whether its outcome was reported.
    is_old: bool,
    stage: Stage,
    /// The ticks that are left to it.
    left: u8,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Stage {
    /// The frame may not have come completely.
    Coming,
    /// The same, and its first half was answered and is kept.
    Half,
    /// The first half of the frame was answered and dropped.
    Rest,
    /// The frame is executed.
    Executing,
}

/// An answer of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Answer {
    /// The word of its class.
    Echo(Class),
    /// An error code.
    Error(Refusal),
    /// Bytes that are not an answer.
    Corrupt,
}

/// A step of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// The caller submits an instruction.
    Submit(Class),
    /// The caller continues.
    Resume,
    /// The driver reports that the frame has left.
    Transmitted,
    /// The frame is taken: queued and answered, or executed.
    Take(usize),
    /// The frame is executed, or that fails.
    Finish(usize, bool),
    /// The frame is answered with an error code.
    Refuse(usize, Refusal),
    /// The first half of the frame is answered with an error code.
    Half(usize),
    /// The oldest answer comes; perhaps corrupt.
    Read {
        /// Whether the answer is corrupt.
        corrupt: bool,
    },
    /// The oldest answer is lost.
    Lose,
    /// An unsolicited answer comes.
    Say(Answer),
}

const REFUSALS: [Refusal; 5] = [
    Refusal::BadChecksum,
    Refusal::BadFrame,
    Refusal::QueueFull,
    Refusal::UnknownCommand,
    Refusal::BadParameters,
];

impl AnyController {
    /// Creates a controller that meets the host's assumptions.
    pub fn new(keeps_rules: bool, drops: bool) -> Self {
        let config = HostConfig {
            // A byte takes 1 ms.
            baud: 10_000,
            longest_frame: 50 * usize::from(LINE),
            answer_timeout: TICK * 3,
            execution_timeout: TICK * u32::from(EXECUTION + SETTLE),
            settle: TICK * u32::from(SETTLE),
            max_pause: TICK * u32::from(PAUSE),
            reply_time: TICK * u32::from(REPLY),
            earlier_execution: TICK * u32::from(EXECUTION),
            controller_drops_partial: drops,
            backoff: TICK,
            full_timeout: TICK * 2,
            resends: 1,
            ..HostConfig::default()
        };
        Self { config, keeps_rules, drops, reports: false, real: Times::ASSUMED }
    }

    fn apply(&self, known: &mut Knowledge, answer: Answer) -> Input {
        match answer {
            Answer::Echo(class) => {
                if let Some(job) = &mut known.job {
                    job.has_come |= job.class == class;
                }
                Input::Answer { word: word(class), refusal: None }
            }
            Answer::Error(refusal) => {
                let word = self.config.words.errors().code(refusal);
                Input::Answer { word, refusal: Some(refusal) }
            }
            Answer::Corrupt => Input::Corrupt,
        }
    }

    fn report(&self, known: &mut Knowledge, _: Batch, outcome: Outcome) {
        let Some(Job { executed, has_come, .. }) = known.job.take() else {
            known.wrong = Some(ONE_OUTCOME);
            return;
        };
        let refused = matches!(outcome, Outcome::Refused(_));
        let answered = matches!(outcome, Outcome::Done { unanswered: 0, .. });
        match outcome {
            Outcome::Done { .. } if self.keeps_rules && executed == 0 => known.wrong = Some(DONE),
            Outcome::Done { .. } if !has_come => known.wrong = Some(CLAIMED),
            Outcome::Done { unanswered: 0, .. } if executed > 1 => known.wrong = Some(DONE_ONCE),
            Outcome::Done { .. } => {}
            Outcome::Refused(_) | Outcome::Unknown(_) if has_come => known.wrong = Some(ECHOED),
            Outcome::Refused(_) | Outcome::Unknown(_) => {}
        }
        known.leave(PreviousFrame { refused, answered, executed });
    }
}

impl Peer for AnyController {
    type End = HostMachine;
    type Knowledge = Knowledge;
    type Step = Step;

    const TICK: Duration = TICK;

    fn config(&self) -> &HostConfig {
        &self.config
    }

    fn end(&self) -> HostMachine {
        HostMachine::NEW
    }

    fn known(&self) -> Knowledge {
        Knowledge {
            frames: Vec::new(),
            answers: Vec::new(),
            job: None,
            leaves: None,
            before: PreviousFrame::default(),
            wrong: None,
        }
    }

    fn steps(&self, end: &HostMachine, known: &Knowledge, steps: &mut Vec<Step>) {
        if matches!(end.link, HostLink::Held { .. }) {
            steps.push(Step::Resume);
        }
        let is_connected = !matches!(end.link, HostLink::Disconnected { .. });
        steps.extend(known.leaves.map(|_| Step::Transmitted));
        if is_connected && !known.answers.is_empty() && known.leaves.is_none() {
            steps.extend([Step::Read { corrupt: false }, Step::Read { corrupt: true }]);
        }
        if !known.answers.is_empty() {
            steps.push(Step::Lose);
        }
        for (at, frame) in known.frames.iter().enumerate() {
            match frame.stage {
                Stage::Executing => steps.extend([Step::Finish(at, true), Step::Finish(at, false)]),
                Stage::Coming | Stage::Half => {
                    steps.push(Step::Take(at));
                    steps.extend(REFUSALS.map(|refusal| Step::Refuse(at, refusal)));
                    steps.extend((frame.stage == Stage::Coming).then_some(Step::Half(at)));
                }
                Stage::Rest => steps.push(Step::Refuse(at, Refusal::BadFrame)),
            }
        }
        if end.next.is_none() && known.job.is_none() {
            steps.extend([Step::Submit(Class::Interpreted), Step::Submit(Class::Immediate)]);
        }
        if !self.keeps_rules && is_connected {
            let classes = [Class::Interpreted, Class::Immediate].map(Answer::Echo);
            let errors = REFUSALS.map(Answer::Error);
            steps.extend(classes.into_iter().chain(errors).chain([Answer::Corrupt]).map(Step::Say));
        }
    }

    fn by(&self, word: Step) -> Actor {
        match word {
            Step::Submit(_) | Step::Resume | Step::Transmitted => Actor::User,
            Step::Read { .. } | Step::Say(_) => Actor::Line,
            Step::Lose | Step::Take(_) | Step::Finish(..) | Step::Refuse(..) | Step::Half(_) => Actor::Others,
        }
    }

    fn apply(&self, _: &HostMachine, known: &mut Knowledge, said: Step) -> Option<Input> {
        match said {
            Step::Submit(class) => return Some(Input::Submit { ticket: 0, word: word(class), class }),
            Step::Resume => return Some(Input::Resume),
            Step::Transmitted => {
                known.leaves = None;
                let is_coming = |frame: &&mut Frame| !frame.is_old && frame.stage != Stage::Executing;
                known.frames.iter_mut().filter(is_coming).for_each(|frame| frame.left = 0);
                return Some(Input::Transmitted);
            }
            Step::Read { corrupt } => {
                let (answer, _) = known.answers.remove(0);
                return Some(self.apply(known, if corrupt { Answer::Corrupt } else { answer }));
            }
            Step::Lose => {
                known.answers.remove(0);
            }
            Step::Say(answer) => return Some(self.apply(known, answer)),
            Step::Take(at) => {
                let frame = known.frames[at];
                if known.execute(frame) && !self.config.resend_on_silence {
                    known.wrong = Some(ONCE);
                }
                if frame.class == Class::Interpreted {
                    known.frames.remove(at);
                    known.answers.push((Answer::Echo(frame.class), self.real.settle));
                } else {
                    known.frames[at] = Frame { stage: Stage::Executing, left: self.real.execution, ..frame };
                }
            }
            Step::Finish(at, good) => {
                let frame = known.frames.remove(at);
                let failed = Answer::Error(Refusal::BadParameters);
                known.answers.push((if good { Answer::Echo(frame.class) } else { failed }, self.real.settle));
            }
            Step::Refuse(at, refusal) => {
                let frame = known.frames.remove(at);
                let left = if frame.stage == Stage::Rest { self.real.settle } else { self.real.reply };
                known.answers.push((Answer::Error(refusal), left));
            }
            Step::Half(at) => {
                known.frames[at].stage = if self.drops { Stage::Rest } else { Stage::Half };
                known.answers.push((Answer::Error(Refusal::BadFrame), self.real.reply));
            }
        }
        None
    }

    fn sent(&self, _: &DueFrame) -> Input {
        Input::Sent { line: TICK * u32::from(LINE) }
    }

    fn acted(&self, end: &HostMachine, known: &mut Knowledge, cause: CauseOf<Self>, action: Action) {
        if let (Cause::Sent(due), HostLink::Awaiting(sent)) = (cause, end.link) {
            if due == DueFrame::Next {
                if known.job.is_some() {
                    known.wrong = Some(ONE_OUTCOME);
                }
                known.job = Some(Job { class: sent.batch.class, executed: 0, has_come: false });
            }
            if self.keeps_rules {
                known.leaves = self.reports.then_some(LINE + self.real.pause);
                let class = sent.batch.class;
                known.frames.push(Frame {
                    class,
                    is_old: false,
                    stage: Stage::Coming,
                    left: LINE + self.real.pause,
                });
            }
        }
        if let Action::Report(batch, outcome) = action {
            self.report(known, batch, outcome);
        }
    }

    /// Drops frames and answers that have not arrived in time.
    fn tick(&self, known: &mut Knowledge) {
        known.frames.retain(|frame| frame.left > 0);
        // An answer waits in the port until its frame is reported as sent.
        known.answers.retain(|(_, left)| *left > 1 || known.leaves.is_some());
        known.frames.iter_mut().for_each(|frame| frame.left -= 1);
        known.answers.iter_mut().for_each(|(_, left)| *left = (*left - 1).max(1));
        known.leaves.iter_mut().for_each(|left| *left -= 1);
    }

    fn restarted(&self, known: &mut Knowledge) {
        let is_coming = |frame: &&mut Frame| matches!(frame.stage, Stage::Coming | Stage::Half);
        // It is a frame of an earlier host from now on.
        for frame in known.frames.iter_mut().filter(|frame| !frame.is_old).filter(is_coming) {
            frame.left = (frame.left + self.real.earlier).saturating_sub(LINE);
        }
        if let Some(job) = known.job.take() {
            known.leave(PreviousFrame { executed: job.executed, ..PreviousFrame::default() });
        }
    }

    /// Instructions have numbers.
    fn forget(&self, host: &mut HostMachine) {
        host.next.iter_mut().for_each(|batch| batch.first = 0);
        match &mut host.link {
            HostLink::Awaiting(sent) => sent.batch.first = 0,
            HostLink::Resending { batch, .. } | HostLink::AwaitingRest { batch, .. } => batch.first = 0,
            HostLink::Disconnected { .. } | HostLink::Idle { .. } | HostLink::Held { .. } => {}
        }
    }

    fn broken(&self, _: &HostMachine, known: &Knowledge, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
    }

    fn is_urgent(&self, _: &HostMachine, known: &Knowledge) -> bool {
        known.leaves == Some(0)
    }

    /// Each frame has an outcome in the end, whatever the controller does.
    fn is_over(&self, end: &HostMachine, known: &Knowledge) -> bool {
        known.job.is_none() && end.next.is_none()
    }

    fn fault_free_step(&self, end: &HostMachine, known: &Knowledge) -> Option<Step> {
        let resume = matches!(end.link, HostLink::Held { .. }).then_some(Step::Resume);
        resume.or(known.leaves.map(|_| Step::Transmitted))
    }
}

impl Knowledge {
    /// Returns whether the frame was executed before.
    fn execute(&mut self, frame: Frame) -> bool {
        let executed = match &mut self.job {
            Some(job) if !frame.is_old => &mut job.executed,
            _ => &mut self.before.executed,
        };
        *executed = (*executed + 1).min(2);
        let is_repeated = *executed > 1;
        if frame.is_old && self.before.refused {
            self.wrong = Some(REFUSED);
        }
        if frame.is_old && self.before.answered && is_repeated {
            self.wrong = Some(DONE_ONCE);
        }
        is_repeated
    }

    /// Called when the frame has its outcome.
    fn leave(&mut self, before: PreviousFrame) {
        if before.refused && before.executed > 0 {
            self.wrong = Some(REFUSED);
        }
        self.before = before;
        self.frames.iter_mut().for_each(|frame| frame.is_old = true);
    }
}

pub(super) fn word(class: Class) -> u16 {
    if class == Class::Interpreted { CUT } else { SWITCH }
}
