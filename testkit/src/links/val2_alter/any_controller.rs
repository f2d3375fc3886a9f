//! A host against controllers of other makers.
//!
//! One axis stands for all six. A host has one bit per axis for its words, and each bit is changed by its own axis
//! alone. Axes interact in the choice of a word, in a stop (the last axis that is not zero delays it), and in the
//! length of a reply. So other axes decide when a word that is not required is left out, whether a reply is at rest,
//! and by when it must begin. All three are left open if replies [are free](AnyController::is_free): each may have
//! a word that moves, or a zero, or [be on the way](Step::Brake). Replies are lost, or late.
//!
//! One mode stands for all, too. The mode decides whether a start message names it, how long the window is (15 or 17
//! ms are the same ticks here), and where values go without a target, which is left open. A transformation makes the
//! message longer, and the window shorter at most.

use core::time::Duration;

use robot_session::end::Machine as _;
use val2_alter::host::machine::{Action, Answer, HostMachine, HostPhase, Input, PendingException};
use val2_alter::{ErrorCode, Exception, HostConfig, Policy, StartCode};

use super::any_robot::{
    AnyController, CYCLE, DELAY, Frame, INTERRUPTION, Job, Knowledge, Opening, RUNNING, Reply, Robot, Step,
    Window,
};
use super::world::{
    DONE, DecoderContents, FITS, FRESH, GRIP, INVENTED_MODE, NOT_DONE, ONCE, OUTCOME, REFUSED, SILENCE,
    SILENT, STALE, TICK, WORDS, ZEROS,
};
use crate::model::{Actor, Cause, CauseOf, EXPECTED, InputOf, Peer, PeerAssumptions};

const NOW: Duration = Duration::ZERO;
pub(super) const ANSWERED: &str = "a message has one answer at most, and nothing is sent unasked";
pub(super) const INTERRUPTED: &str = "no exception is sent in an interruption";
pub(super) const REJECTED: &str = "an error code is not taken for the last reply's when that was read";
pub(super) const DELAYED: &str = "a message is not reported as delayed when it is not";
pub(super) const AGAIN: &str = "an exception is sent again only after messages that say it was not read";

pub(super) const RULES: PeerAssumptions = PeerAssumptions {
    keeps: "AL-71, AL-72, AL-73, AL-75, AL-76, AL-77, AL-78, AL-79, AL-90, delays no longer than max_delay",
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
        REFUSED,
        DELAYED,
        EXPECTED,
    ],
};
pub(super) const LATER: PeerAssumptions = PeerAssumptions {
    keeps: "AL-71, AL-72, AL-73, AL-75, AL-76, AL-77, AL-78, AL-79, AL-90, replies no later than a cycle; words that come in an interruption stay",
    free: "which errors it finds, whether it goes on without a reply, which of two replies a window has, what is lost or corrupt, when it \
           interrupts and ends",
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
        REFUSED,
        EXPECTED,
    ],
};
pub(super) const LATE: PeerAssumptions = PeerAssumptions {
    keeps: "AL-71, AL-72, AL-73, AL-75, AL-76, AL-78, AL-79, AL-90, delays no longer than max_delay",
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
pub(super) const ANYTHING: PeerAssumptions = PeerAssumptions {
    keeps: "",
    free: "any message, whole, in part or corrupt, and noise at any time",
    shows: &[("AL-53", FITS), ("AL-54", ANSWERED), ("AL-67", INTERRUPTED)],
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
        REFUSED,
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
    type Knowledge = Knowledge;
    type Step = Step;

    const TICK: Duration = TICK;

    fn config(&self) -> &HostConfig {
        &self.config
    }

    fn end(&self) -> HostMachine {
        HostMachine::new(self.config.policy, self.config.subroutine)
    }

    fn known(&self) -> Knowledge {
        Knowledge {
            robot: Robot::Off,
            sending: false,
            since_sent: CYCLE,
            window: Window::Nothing,
            held: false,
            taken: false,
            down: None,
            up: [None; 2],
            late: 0,
            line: DecoderContents::Nothing,
            inputs: Vec::new(),
            asked: None,
            started: None,
            since_read: 0,
            corrupt: (0, 0),
            job: None,
            target: FRESH,
            wanted: false,
            arm: (false, false),
            stopped: false,
            reply: None,
            wrong: None,
        }
    }

    fn steps(&self, end: &HostMachine, known: &Knowledge, steps: &mut Vec<Step>) {
        if self.keeps_rules {
            known.robot_steps(self, steps);
            if end.phase != HostPhase::Disconnected && known.down.is_some() && !known.sending {
                steps.push(Step::Read { corrupt: false });
                if !(self.takes_late && matches!(known.down, Some(Frame::Start { .. }))) {
                    steps.push(Step::Read { corrupt: true });
                }
            }
        } else if end.phase != HostPhase::Disconnected {
            steps.extend(FRAMES.map(Step::Come));
            if known.line != DecoderContents::Head {
                steps.extend([Step::Head, Step::Noise]);
            }
        }
        if self.is_free
            && let Some(Answer::Reply { .. }) = end.transmit(NOW, &self.config)
        {
            steps.extend([Step::Move, Step::Brake]);
        }
        let HostPhase::Active(active) = &end.phase else {
            if end.policy != Policy::Accept {
                steps.push(Step::Accept);
            }
            return;
        };
        // If the source of the motion makes no difference, there is no target.
        if !(self.is_free && self.keeps_rules) {
            steps.push(Step::Target { moves: true });
        }
        // With a controller that does anything a stop brings the arm back.
        if !self.is_free && self.keeps_rules {
            steps.push(Step::Target { moves: false });
        }
        steps.push(Step::Stop);
        if end.subroutine && end.name() == "running" && active.exception == PendingException::None {
            steps.push(Step::Ask);
        }
    }

    fn by(&self, step: Step) -> Actor {
        match step {
            Step::Read { .. } | Step::Come(_) | Step::Head | Step::Noise => Actor::Line,
            Step::Move | Step::Brake | Step::Target { .. } | Step::Ask | Step::Stop | Step::Accept => {
                Actor::User
            }
            Step::Say(_) | Step::Lose | Step::Arrive { .. } => Actor::Others,
            Step::Interrupt | Step::Return | Step::Restart => Actor::Others,
        }
    }

    fn apply(&self, end: &HostMachine, known: &mut Knowledge, step: Step) -> Option<InputOf<Self>> {
        match step {
            Step::Read { corrupt } => {
                let frame = known.down.take()?;
                known.late = known.since_sent;
                self.receive(end, known, if corrupt { Frame::Corrupt } else { frame });
            }
            Step::Come(frame) => self.receive(end, known, frame),
            Step::Head => {
                known.end_noise();
                known.hold(DecoderContents::Head);
            }
            Step::Noise => known.hold(known.line.with_noise()),
            Step::Move => return Some(self.reply(end, known, true, false)),
            Step::Brake => return Some(self.reply(end, known, false, false)),
            Step::Target { moves } => {
                (known.target, known.wanted) = (0, moves && !self.is_free);
                return Some(Input::Target);
            }
            Step::Ask => {
                known.job = Some(Job { executed: 0, sent: None });
                return Some(Input::Exception { exception: GRIP, has_room: true });
            }
            Step::Stop => {
                known.started = None;
                return Some(Input::Stop);
            }
            Step::Accept => return Some(Input::Policy(Policy::Accept)),
            Step::Say(frame) => known.say(frame),
            Step::Lose => known.down = None,
            Step::Arrive { corrupt, takes } => known.arrive(self.takes_late, corrupt, takes),
            Step::Interrupt => known.robot = Robot::Interrupted { reported: false },
            Step::Return => known.robot = Robot::Running,
            Step::Restart => {
                (known.robot, known.since_sent, known.down) = (Robot::Off, CYCLE, None);
                known.sending = false;
                (known.held, known.window) = (false, Window::Nothing);
            }
        }
        known.next_input()
    }

    fn next(&self, _: &HostMachine, known: &mut Knowledge) -> Option<InputOf<Self>> {
        known.next_input()
    }

    fn sent(&self, answer: &Answer) -> InputOf<Self> {
        match answer {
            Answer::Nothing => Input::Ignored,
            Answer::Start(_) | Answer::Reply { .. } => Input::Sent { moving: 0, at_rest: true },
        }
    }

    fn answer(&self, end: &HostMachine, known: &mut Knowledge, what: &Answer) -> InputOf<Self> {
        match what {
            Answer::Nothing => Input::Ignored,
            Answer::Start(_) | Answer::Reply { .. } => self.reply(end, known, false, true),
        }
    }

    fn acted(&self, end: &HostMachine, known: &mut Knowledge, cause: CauseOf<Self>, action: Action) {
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
                let is_often = known.corrupt.0 > self.config.repeats;
                match code {
                    StartCode::Accept => {
                        must(started == Some(Opening::Expected), INVENTED_MODE);
                        (known.since_read, known.stopped, known.target) = (0, false, FRESH);
                        (known.wanted, known.arm) = (false, (false, false));
                        known.answered(self, Reply::Accept);
                    }
                    StartCode::Repeat => {}
                    StartCode::Refuse => must(
                        started == Some(Opening::Other) || started == Some(Opening::Corrupt) && is_often,
                        REFUSED,
                    ),
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
                let exception = has_exception.then_some(true);
                known.answered(self, Reply::Values { has_word, moves, exception });
            }
            Action::Stopped(judged) => {
                known.stopped = true;
                known.rest(judged.missed, judged.rejected);
                must(!self.keeps_rules || !known.held, ZEROS);
                must(!known.is_misjudged(self, judged.rejected), REJECTED);
                known.end_job(self, judged.outcome, &mut must);
            }
            Action::Asked(judged) => {
                must(!(self.keeps_rules && judged.delayed), DELAYED);
                known.rest(judged.missed, judged.rejected);
                must(!known.is_misjudged(self, judged.rejected), REJECTED);
                known.end_job(self, judged.outcome, &mut must);
            }
            Action::Missed => {
                known.rest(true, None);
                if cause == Cause::Due {
                    (known.asked, known.started) = (None, None);
                }
            }
            Action::EndFrame => match core::mem::replace(&mut known.line, DecoderContents::Nothing) {
                DecoderContents::Noise => known.lose_noise(),
                DecoderContents::Head => {
                    let input = self.read(end, known, Frame::Corrupt);
                    known.inputs.push(input);
                }
                DecoderContents::Nothing | DecoderContents::Corrupt => {}
            },
            Action::Exception(exception, outcome) => {
                known.end_job(self, Some((exception, outcome)), &mut must)
            }
            Action::Ended(outcome) | Action::Lost { outcome, .. } => known.end_job(self, outcome, &mut must),
            Action::Refuse(_) => known.job = None,
            Action::Nothing | Action::Stale => {}
        }
        match cause {
            Cause::Connected | Cause::Disconnected => {
                (known.asked, known.started, known.stopped) = (None, None, false);
                (known.line, known.corrupt) = (DecoderContents::Nothing, (0, 0));
            }
            Cause::Sent(Answer::Nothing) => known.started = None,
            Cause::Due | Cause::Sent(_) | Cause::Step(_) => {}
        }
        if !matches!(end.phase, HostPhase::Active(_)) {
            (known.target, known.wanted, known.arm) = (FRESH, false, (false, false));
        }
        known.wrong = known.wrong.or(wrong);
    }

    fn tick(&self, known: &mut Knowledge) {
        let older = |ticks: &mut u8, most: u8| *ticks = (*ticks + 1).min(most);
        if core::mem::take(&mut known.sending) {
            known.since_sent = 0;
        } else {
            older(&mut known.since_sent, CYCLE);
        }
        older(&mut known.since_read, self.silence() + 1);
        if known.corrupt.0 > 0 && known.line != DecoderContents::Head {
            older(&mut known.corrupt.1, self.silence());
        }
        if known.corrupt.1 == self.silence() {
            known.corrupt = (0, 0);
        }
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

    fn restarted(&self, known: &mut Knowledge) {
        let Knowledge { robot, sending, since_sent, window, held, taken, down, up, late, wrong, .. } = *known;
        *known = Knowledge {
            robot,
            sending,
            since_sent,
            window,
            held,
            taken,
            down,
            up,
            late,
            wrong,
            ..self.known()
        };
        known.forget_exception();
    }

    fn broken(&self, end: &HostMachine, known: &Knowledge, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
        let HostPhase::Active(active) = &end.phase else {
            if known.job.is_some() {
                broken.push(OUTCOME);
            }
            return;
        };
        if known.job.is_some() != (active.exception != PendingException::None) {
            broken.push(OUTCOME);
        }
        if known.since_read > self.silence() && !end.expires(NOW) {
            broken.push(SILENCE);
        }
    }

    /// Returns whether each exception has its outcome, which must happen whatever the controller does.
    fn is_over(&self, _: &HostMachine, known: &Knowledge) -> bool {
        known.job.is_none()
    }

    /// Returns the faultless step: the controller sends a message in each cycle and reads each reply.
    fn fault_free_step(&self, end: &HostMachine, known: &Knowledge) -> Option<Step> {
        let mut steps = Vec::new();
        if self.keeps_rules {
            self.steps(end, known, &mut steps);
        }
        steps.into_iter().find(|step| match step {
            Step::Arrive { corrupt, takes } => !corrupt && *takes,
            Step::Read { corrupt } => !corrupt,
            Step::Say(frame) => *frame != Frame::End,
            Step::Return | Step::Accept => true,
            _ => false,
        })
    }
}
