//! A host against controllers that are not ours.
//!
//! One axis stands for all six. What a host knows of words is a bit for each axis, and each is changed by its own bit alone. Axes meet
//! where a word is chosen, where the last one that is not zero keeps a stop from being done, and in how long a reply is. So other axes
//! decide when a word is left out that need not be there, whether a reply is at rest, and by when it has to begin. Here all three are
//! open: any reply may have a word that moves, or a zero, or [be on the way](Word::Brake), and replies are lost, or late.
//!
//! One mode stands for all, too. A machine asks it whether a start message names it, how long the window is (15 or 17 ms are the same
//! ticks here), and where values go without a target, which is open. A transformation makes the message longer, and the window
//! shorter at most.

use core::time::Duration;

use robot_session::end::Machine as _;
use val2_alter::host::machine::{Action, Answer, Course, Draft, HostMachine, HostPhase, Input, Pending};
use val2_alter::{AXES, ErrorCode, Exception, HostConfig, Policy, timing};

use super::any_robot::{
    AnyController, CYCLE, DELAY, Frame, INTERRUPTION, Job, Known, RUNNING, Reply, Robot, Window, Word,
};
use super::setup::{FRESH, TICK};
use super::world::{
    DONE, FITS, GRIP, INVENTED_MODE, Message, NOT_DONE, ONCE, OUTCOME, SILENCE, SILENT, STALE, WORDS, ZEROS,
};
use crate::model::{By, Cause, CauseOf, EXPECTED, InputOf, Peer, Terms};

const NOW: Duration = Duration::ZERO;
pub(super) const ANSWERED: &str = "a message has one answer at most, and nothing is sent unasked";
pub(super) const INTERRUPTED: &str = "no exception is sent in an interruption";
pub(super) const REJECTED: &str = "an error code is not taken for the last reply's when that was read";
pub(super) const DELAYED: &str = "a message is not reported as delayed when it is not";
pub(super) const AGAIN: &str = "an exception is sent again only after messages that say it was not read";

pub(super) const RULES: Terms = Terms {
    keeps: "AL-71 to AL-73, AL-75 to AL-79, AL-90, delays no longer than max_delay",
    free: "which errors it finds, whether it goes on without a reply, what it makes of words that come in an interruption, what is \
           lost or corrupt, when it interrupts, ends and restarts",
    shows: &[],
    properties: &[
        ONCE,
        DONE,
        NOT_DONE,
        OUTCOME,
        WORDS,
        ZEROS,
        FITS,
        SILENT,
        SILENCE,
        ANSWERED,
        INTERRUPTED,
        REJECTED,
        DELAYED,
        EXPECTED,
    ],
};
pub(super) const LATER: Terms = Terms {
    keeps: "AL-71 to AL-73, AL-75 to AL-79, AL-90, replies no later than a cycle; words that come in an interruption stay",
    free: "which errors it finds, whether it goes on without a reply, which of two replies a window has, what is lost or corrupt, when it \
           interrupts and ends",
    shows: &[],
    properties: &[WORDS, ZEROS, FITS, SILENT, SILENCE, ANSWERED, EXPECTED],
};
pub(super) const LATE: Terms = Terms {
    keeps: "AL-71 to AL-73, AL-75, AL-76, AL-78, AL-79, AL-90, delays no longer than max_delay",
    free: "which errors it finds, whether it goes on without a reply and takes one that is late, what it makes of words that come in an \
           interruption, what is lost, or corrupt after the start, when it interrupts, ends and restarts",
    shows: &[],
    properties: &[
        ONCE,
        DONE,
        NOT_DONE,
        OUTCOME,
        WORDS,
        ZEROS,
        FITS,
        SILENT,
        ANSWERED,
        INTERRUPTED,
        DELAYED,
        EXPECTED,
    ],
};
pub(super) const ANYTHING: Terms = Terms {
    keeps: "",
    free: "any message and noise at any time",
    shows: &[],
    properties: &[
        OUTCOME,
        AGAIN,
        FITS,
        STALE,
        SILENT,
        SILENCE,
        ANSWERED,
        INTERRUPTED,
        INVENTED_MODE,
        EXPECTED,
    ],
};

const FRAMES: [Frame; 8] = [
    Frame::Start { is_expected: true },
    Frame::Start { is_expected: false },
    Frame::Motion(RUNNING, ErrorCode::None),
    Frame::Motion(RUNNING, ErrorCode::Checksum),
    Frame::Motion(INTERRUPTION, ErrorCode::None),
    Frame::Motion(INTERRUPTION, ErrorCode::Checksum),
    Frame::End,
    Frame::Corrupt,
];

impl Peer for AnyController {
    type End = HostMachine;
    type Known = Known;
    type Word = Word;

    const TICK: Duration = TICK;

    fn config(&self) -> &HostConfig {
        &self.config
    }

    fn end(&self) -> HostMachine {
        HostMachine::new(Policy::Accept, true)
    }

    fn known(&self) -> Known {
        Known {
            robot: Robot::Off,
            sending: false,
            since_sent: CYCLE,
            window: Window::Nothing,
            held: false,
            taken: false,
            down: None,
            up: [None; 2],
            late: 0,
            asked: None,
            started: None,
            since_read: 0,
            job: None,
            target: FRESH,
            stopped: false,
            reply: None,
            wrong: None,
        }
    }

    fn words(&self, end: &HostMachine, known: &Known, words: &mut Vec<Word>) {
        if self.keeps_rules {
            known.robot_words(self, words);
            if end.phase != HostPhase::Disconnected && known.down.is_some() && !known.sending {
                words.push(Word::Read { corrupt: false });
                if !(self.takes_late && matches!(known.down, Some(Frame::Start { .. }))) {
                    words.push(Word::Read { corrupt: true });
                }
            }
        } else if end.phase != HostPhase::Disconnected {
            words.extend(FRAMES.map(Word::Come));
            words.push(Word::Noise);
        }
        if let Some(Answer::Reply { .. }) = end.transmit(NOW, &self.config) {
            words.extend([Word::Move, Word::Brake]);
        }
        let HostPhase::Active(active) = &end.phase else {
            if end.policy != Policy::Accept {
                words.push(Word::Accept);
            }
            return;
        };
        // Where it makes no difference what moves the arm, there is no target.
        if !self.keeps_rules {
            words.push(Word::Target);
        }
        words.push(Word::Stop);
        if end.name() == "running" && active.exception == Pending::None && self.delay <= DELAY {
            words.push(Word::Ask);
        }
    }

    fn by(&self, word: Word) -> By {
        match word {
            Word::Read { .. } | Word::Come(_) | Word::Noise => By::Line,
            Word::Move | Word::Brake | Word::Target | Word::Ask | Word::Stop | Word::Accept => By::User,
            Word::Say(_) | Word::Lose | Word::Arrive { .. } => By::Others,
            Word::Interrupt | Word::Return | Word::Restart => By::Others,
        }
    }

    fn hear(&self, end: &HostMachine, known: &mut Known, word: Word) -> Option<InputOf<Self>> {
        match word {
            Word::Read { corrupt } => {
                let frame = known.down.take()?;
                known.late = known.since_sent;
                return Some(self.read(end, known, if corrupt { Frame::Corrupt } else { frame }));
            }
            Word::Come(frame) => return Some(self.read(end, known, frame)),
            Word::Noise => {
                known.lose_sequence();
                return Some(Input::Noise);
            }
            Word::Move => return Some(self.reply(end, known, true, false)),
            Word::Brake => return Some(self.reply(end, known, false, false)),
            Word::Target => {
                known.target = 0;
                return Some(Input::Target);
            }
            Word::Ask => {
                known.job = Some(Job { executed: 0, sent: None });
                return Some(Input::Exception { exception: GRIP, has_room: true });
            }
            Word::Stop => return Some(Input::Stop),
            Word::Accept => return Some(Input::Policy(Policy::Accept)),
            Word::Say(frame) => known.say(frame),
            Word::Lose => known.down = None,
            Word::Arrive { corrupt, takes } => known.arrive(self.takes_late, corrupt, takes),
            Word::Interrupt => known.robot = Robot::Interrupted { reported: false },
            Word::Return => known.robot = Robot::Running,
            Word::Restart => {
                (known.robot, known.since_sent, known.down) = (Robot::Off, CYCLE, None);
                known.sending = false;
                (known.held, known.window) = (false, Window::Nothing);
            }
        }
        None
    }

    fn sent(&self, answer: &Answer) -> InputOf<Self> {
        match answer {
            Answer::Nothing => Input::Ignored,
            Answer::Start(_) | Answer::Reply { .. } => Input::Sent { moving: 0, at_rest: true },
        }
    }

    fn answer(&self, end: &HostMachine, known: &mut Known, what: &Answer) -> InputOf<Self> {
        match what {
            Answer::Nothing => Input::Ignored,
            Answer::Start(_) | Answer::Reply { .. } => self.reply(end, known, false, true),
        }
    }

    fn acted(&self, end: &HostMachine, known: &mut Known, cause: CauseOf<Self>, action: Action) {
        let reply = known.reply.take();
        let mut wrong = None;
        let mut must = |holds: bool, what| {
            if !holds {
                wrong = Some(what);
            }
        };
        match action {
            Action::SentStart(code) => {
                let started = known.started.take();
                must(started.is_some(), ANSWERED);
                if code == val2_alter::StartCode::Accept {
                    must(started == Some(true), INVENTED_MODE);
                    (known.since_read, known.stopped, known.target) = (0, false, FRESH);
                    known.answered(self, Reply::Accept);
                }
            }
            Action::SentReply(exception) => {
                let has_exception = exception != Exception::None;
                let asked = known.asked.take();
                must(asked.is_some(), ANSWERED);
                must(!known.stopped, SILENT);
                must(!has_exception || asked == Some(RUNNING), INTERRUPTED);
                if has_exception && let Some(job) = &mut known.job {
                    must(self.keeps_rules || matches!(job.sent, None | Some((2, true))), AGAIN);
                    job.sent = Some((0, true)).filter(|_| !self.keeps_rules);
                }
                let (select, moves) = reply.unwrap_or_default();
                let has_word = select & 1 != 0;
                known.answered(self, Reply::Values { has_word, moves, exception: has_exception });
            }
            Action::Stopped(judged) => {
                known.stopped = true;
                must(!self.keeps_rules || !known.held, ZEROS);
                must(!known.is_misjudged(self, judged.rejected), REJECTED);
                known.end_job(self, judged.outcome, &mut must);
            }
            Action::Asked(judged) => {
                must(!(self.keeps_rules && judged.delayed), DELAYED);
                must(!known.is_misjudged(self, judged.rejected), REJECTED);
                known.end_job(self, judged.outcome, &mut must);
            }
            Action::Missed if cause == Cause::Due => (known.asked, known.started) = (None, None),
            Action::Exception(exception, outcome) => {
                known.end_job(self, Some((exception, outcome)), &mut must)
            }
            Action::Ended(outcome) | Action::Lost { outcome, .. } => known.end_job(self, outcome, &mut must),
            Action::Refuse(_) => known.job = None,
            Action::Nothing | Action::EndFrame | Action::Stale | Action::Missed => {}
        }
        if matches!(cause, Cause::Connected | Cause::Disconnected) {
            (known.asked, known.started, known.stopped) = (None, None, false);
        }
        known.target = if matches!(end.phase, HostPhase::Active(_)) { known.target } else { FRESH };
        known.wrong = known.wrong.or(wrong);
    }

    fn tick(&self, known: &mut Known) {
        let older = |ticks: &mut u8, most: u8| *ticks = (*ticks + 1).min(most);
        if core::mem::take(&mut known.sending) {
            known.since_sent = 0;
        } else {
            older(&mut known.since_sent, CYCLE);
        }
        older(&mut known.since_read, self.silence() + 1);
        if self.config.target_timeout < Duration::MAX {
            older(&mut known.target, FRESH);
        }
        if !known.sending && known.since_sent > DELAY {
            known.down = None;
        }
        if self.takes_late {
            known.since_read = 0;
        }
        known.up = known.up.map(|up| up.and_then(|(reply, ticks)| Some((reply, ticks.checked_sub(1)?))));
        if known.up[0].is_none() {
            known.up.swap(0, 1);
        }
        if known.up[0].is_none() && known.asked.is_none() && known.started.is_none() {
            known.late = 0;
        }
    }

    fn restarted(&self, known: &mut Known) {
        let Known { robot, sending, since_sent, window, held, taken, down, up, late, wrong, .. } = *known;
        *known =
            Known { robot, sending, since_sent, window, held, taken, down, up, late, wrong, ..self.known() };
    }

    fn broken(&self, end: &HostMachine, known: &Known, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
        let HostPhase::Active(active) = &end.phase else {
            if known.job.is_some() {
                broken.push(OUTCOME);
            }
            return;
        };
        if known.job.is_some() != (active.exception != Pending::None) {
            broken.push(OUTCOME);
        }
        if known.since_read > self.silence() && !end.expires(NOW) {
            broken.push(SILENCE);
        }
    }

    /// Whatever the controller does, an exception has its outcome in the end.
    fn is_over(&self, _: &HostMachine, known: &Known) -> bool {
        known.job.is_none()
    }
}

impl AnyController {
    /// After how many ticks without a message the controller counts as lost.
    fn silence(&self) -> u8 {
        CYCLE * self.config.silence_cycles as u8
    }

    /// The host reads a message.
    fn read(&self, end: &HostMachine, known: &mut Known, frame: Frame) -> Input {
        let is_active = matches!(end.phase, HostPhase::Active(_));
        match frame {
            Frame::Start { is_expected } => {
                (known.started, known.asked) = (Some(is_expected), None);
                Input::Start { is_expected }
            }
            Frame::Motion(phase, error) => {
                known.asked = is_active.then_some(phase);
                let follows = u32::from(known.since_read) * TICK + self.config.max_delay < timing::CYCLE * 2;
                known.since_read = 0;
                if let Some(Job { sent: Some((messages, unread)), .. }) = &mut known.job
                    && *messages < 2
                {
                    let is_unread = *messages > 0 || error != ErrorCode::None;
                    *unread &= is_unread && phase == RUNNING && follows;
                    *messages += 1;
                }
                Input::Motion { phase, error, len: Message::MOTION_LEN.into() }
            }
            Frame::End => {
                (known.started, known.asked) = (None, None);
                Input::End
            }
            Frame::Corrupt => {
                known.lose_sequence();
                // It may have been a start message.
                if !is_active {
                    known.started = known.started.or(Some(false));
                }
                Input::CorruptFrame
            }
        }
    }

    /// What the host does with the answer that is due.
    fn reply(&self, end: &HostMachine, known: &mut Known, moves: bool, at_rest: bool) -> Input {
        let Some(answer) = end.transmit(NOW, &self.config) else { return Input::Late };
        let (bare, end_by) = match &end.phase {
            HostPhase::Active(active) => (8, active.request.map(|request| request.due.end_by)),
            HostPhase::Starting { answer, .. } | HostPhase::Repeating { answer: Some(answer), .. } => {
                (7, Some(answer.end_by))
            }
            _ => (7, None),
        };
        let draft = Draft { bare, words: [2; AXES], moving: moves.into() };
        let Some((select, _)) = end.select(NOW, &draft, &self.config) else { return Input::Late };
        let len = usize::from(bare) + 2 * select.count_ones() as usize;
        if end_by.is_none_or(|end_by| timing::transmission_time(len, self.config.baud) > end_by) {
            known.wrong = known.wrong.or(Some(FITS));
        }
        let is_follower = matches!(answer, Answer::Reply { course: Course::Target, .. });
        if is_follower && known.target >= FRESH {
            known.wrong = known.wrong.or(Some(STALE));
        }
        let moving = draft.moving & select;
        known.reply = Some((select, moving != 0));
        Input::Sent { moving, at_rest }
    }
}
