//! A central controller against devices of other makers.

use core::time::Duration;

use mmacell_proto::central::machine::{self as central, CentralLink, CentralMachine, Input};
use mmacell_proto::{
    Central, CentralConfig, CentralEvent as Event, Closing, Command, DecodeError, ErrorCode, Mode, Progress,
    Reply, Status, Unfinished,
};

use super::world::{
    ARRIVED, BETWEEN, DONE, HOME, NO_BREAK, NO_TARGET, NOT_DONE, NOT_MISSED, ONCE, OUTCOME, Pose, STRAY,
    TICK, bytes,
};
use crate::faults::Faults;
use crate::model::{By, Cause, CauseOf, EXPECTED, InputOf, Peer, SceneOf, Terms, WRITTEN, Wired};

const THERE: Pose = Pose::from_units([10_000, 0]);
const MOVE: Command<Pose> = Command::Move { mode: Mode::Absolute, pose: THERE };

const CLAIMED: &str = "done: the device has said so since it was asked";

pub(super) const RULES: Terms = Terms {
    keeps: "MM-3, MM-4, MM-18, MM-20",
    free: "when it answers and obeys, what it refuses, what stops its axes and where",
    shows: &[("MM-3", ONCE), ("MM-4", ONCE), ("MM-13", WRITTEN)],
    properties: &[OUTCOME, ONCE, CLAIMED, DONE, NOT_DONE, ARRIVED, NOT_MISSED, NO_TARGET, NO_BREAK, EXPECTED],
};
pub(super) const ANYTHING: Terms = Terms {
    keeps: "",
    free: "any line at any time",
    shows: &[],
    properties: &[OUTCOME, CLAIMED, NOT_DONE, ARRIVED, NO_TARGET, STRAY, EXPECTED],
};

/// A device of which only this is known.
#[derive(Debug, Clone, Copy)]
pub struct AnyDevice {
    /// The central controller's configuration.
    pub config: CentralConfig,
    /// It answers each command once, with the true state of its axes, and sends only replies (MM-3, MM-18, MM-20). The model
    /// leaves open the times of its answers, whether it executes commands, and the reasons for which its axes stop.
    pub keeps_rules: bool,
    /// It repeats an earlier agreement after the next command was sent. No central controller can see that.
    pub repeats: bool,
}

/// The model's knowledge of the device and of the caller's command.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Known {
    /// The command without an outcome for the caller, and its fate.
    pending: Option<(Command<Pose>, Fate)>,
    /// The command that the device has not answered.
    asked: Option<Command<Pose>>,
    /// Whether the device has carried out that command.
    obeyed: bool,
    axes: Axes,
    /// Whether it has begun to move in this tick: it may still report that it is at rest.
    young: bool,
    /// Whether the next line is not an answer.
    stray: bool,
    /// Whether the device has accepted a motion on this connection, and no command that ends it, as far as the caller knows.
    has_target: bool,
    wrong: Option<&'static str>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Fate {
    /// The central controller has not sent it.
    Unsent,
    /// The command was sent.
    Sent,
    /// The device has reported that it is done, or that it is refused.
    Answered,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Axes {
    moving: bool,
    at: Pose,
    servo: bool,
}

/// A step of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Word {
    /// The caller requests a command.
    Request(Command<Pose>),
    /// The caller aborts.
    Abort,
    /// A reply comes.
    Reply(Reply<Pose>),
    /// A line arrives that is not a reply.
    Corrupt,
    /// The device carries out the command.
    Obey,
    /// The axes of the device come to rest here.
    Rest(Pose),
    /// The servo motors of the device go off.
    Off,
}

const REQUESTS: [Command<Pose>; 6] =
    [MOVE, Command::Status, Command::Stop, Command::Reset, Command::Servo { on: false }, Command::Close];
const REFUSAL: Reply<Pose> = Reply::Error { error: ErrorCode::Generic };

impl AnyDevice {
    fn statuses(&self) -> impl Iterator<Item = Reply<Pose>> {
        let axes = |moving, at, servo| Axes { moving, at, servo }.status();
        [axes(true, HOME, true), axes(false, HOME, true), axes(false, THERE, true), axes(false, THERE, false)]
            .into_iter()
    }

    fn report(&self, known: &mut Known, event: Event<Pose>) {
        let (outcome, command) = match event {
            Event::Connected | Event::Unexpected(_) => return,
            Event::Done { command } => (DONE, Some(command)),
            Event::Refused { command, .. } => (NOT_DONE, Some(command)),
            Event::Aborted { command } => (NOT_DONE, Some(command)),
            Event::Status { status, motion } => {
                self.judge(known, status, motion);
                ("", Some(Command::Status))
            }
            Event::Closed { reason, unfinished } => {
                if self.keeps_rules && matches!(reason, Closing::Mismatch | Closing::Malformed(_)) {
                    known.wrong = Some(NO_BREAK);
                }
                match unfinished {
                    Unfinished::Nothing if reason == Closing::Agreed => (DONE, Some(Command::Close)),
                    Unfinished::Nothing => ("", None),
                    Unfinished::NotSent(command) => (NOT_DONE, Some(command)),
                    Unfinished::Unknown(command) => ("", Some(command)),
                }
            }
            _ => ("", None),
        };
        let pending = known.pending.take();
        if pending.map(|(command, _)| command) != command {
            known.wrong = Some(OUTCOME);
        }
        let Some((_, fate)) = pending else { return };
        let has_answered = fate == Fate::Answered;
        if outcome == DONE && !has_answered {
            known.wrong = Some(CLAIMED);
        }
        if outcome == NOT_DONE && fate == Fate::Sent {
            known.wrong = Some(NOT_DONE);
        }
        if outcome == DONE && self.keeps_rules && !known.obeyed {
            known.wrong = Some(DONE);
        }
        if outcome == NOT_DONE && self.keeps_rules && known.obeyed && fate != Fate::Unsent {
            known.wrong = Some(NOT_DONE);
        }
        match command {
            Some(MOVE) if outcome == DONE => known.has_target = true,
            Some(Command::Stop | Command::Reset | Command::Servo { on: false }) if outcome == DONE => {
                known.has_target = false
            }
            _ => {}
        }
    }

    /// Checks the conclusion from a status.
    fn judge(&self, known: &mut Known, status: Status<Pose>, motion: Progress) {
        match motion {
            Progress::Missed(_) if self.keeps_rules && known.axes.moving => known.wrong = Some(NOT_MISSED),
            Progress::Arrived if !known.has_target => known.wrong = Some(NO_TARGET),
            Progress::Arrived if status.moving || !status.servo || status.pose != THERE => {
                known.wrong = Some(ARRIVED)
            }
            _ => {}
        }
    }
}

impl Peer for AnyDevice {
    type End = CentralMachine<Pose>;
    type Known = Known;
    type Word = Word;

    const TICK: Duration = TICK;

    fn config(&self) -> &CentralConfig {
        &self.config
    }

    fn end(&self) -> CentralMachine<Pose> {
        CentralMachine::NEW
    }

    fn known(&self) -> Known {
        let axes = Axes { moving: false, at: HOME, servo: true };
        Known {
            pending: None,
            asked: None,
            obeyed: false,
            axes,
            young: false,
            stray: false,
            has_target: false,
            wrong: None,
        }
    }

    fn words(&self, end: &CentralMachine<Pose>, known: &Known, words: &mut Vec<Word>) {
        match end.link {
            CentralLink::Idle => words.extend(REQUESTS.map(Word::Request)),
            CentralLink::Sending { .. } | CentralLink::Awaiting { .. } => words.push(Word::Abort),
            CentralLink::Down | CentralLink::Ended => {}
        }
        if !self.keeps_rules {
            if end.link != CentralLink::Down {
                words.extend([Reply::Ok, REFUSAL].into_iter().chain(self.statuses()).map(Word::Reply));
                words.push(Word::Corrupt);
            }
            return;
        }
        if known.axes.moving {
            words.extend([HOME, BETWEEN, THERE].map(Word::Rest));
        }
        if known.axes.servo {
            words.push(Word::Off);
        }
        match known.asked {
            None => {}
            Some(Command::Status) => {
                words.extend([known.axes.status(), REFUSAL].map(Word::Reply));
                if known.young {
                    words.push(Word::Reply(Axes { moving: false, ..known.axes }.status()));
                }
            }
            Some(_) if known.obeyed => words.push(Word::Reply(Reply::Ok)),
            Some(_) => words.extend([Word::Obey, Word::Reply(REFUSAL)]),
        }
        if self.repeats && known.asked.is_some() {
            words.push(Word::Reply(Reply::Ok));
        }
    }

    fn by(&self, word: Word) -> By {
        match word {
            Word::Request(_) | Word::Abort => By::User,
            Word::Reply(_) | Word::Corrupt => By::Line,
            Word::Obey | Word::Rest(_) | Word::Off => By::Others,
        }
    }

    fn hear(&self, end: &CentralMachine<Pose>, known: &mut Known, word: Word) -> Option<InputOf<Self>> {
        let mut axes = known.axes;
        let input = match word {
            Word::Request(command) => {
                known.pending = Some((command, Fate::Unsent));
                Some(Input::Request(command))
            }
            Word::Abort => Some(Input::Abort),
            Word::Reply(reply) => {
                known.asked = None;
                // A device that has reported a motion does not report afterwards that it has not begun.
                known.young &= !matches!(reply, Reply::Status(status) if status.moving);
                known.stray = matches!(end.link, CentralLink::Idle | CentralLink::Sending { .. });
                let fits = matches!(end.link, CentralLink::Awaiting { .. });
                if let (Some((_, fate)), true) = (&mut known.pending, fits) {
                    *fate = Fate::Answered;
                }
                Some(Input::Reply(reply))
            }
            Word::Corrupt => Some(Input::Corrupt(DecodeError::Incomplete)),
            Word::Obey => {
                known.obeyed = true;
                match known.asked {
                    Some(MOVE | Command::Reset) => {
                        axes = Axes { moving: true, servo: true, ..axes };
                        known.young = true;
                    }
                    Some(Command::Stop) => axes.moving = false,
                    Some(Command::Servo { on }) => axes = Axes { moving: false, servo: on, ..axes },
                    _ => {}
                }
                None
            }
            Word::Rest(at) => {
                axes = Axes { moving: false, at, ..axes };
                None
            }
            Word::Off => {
                axes = Axes { moving: false, servo: false, ..axes };
                None
            }
        };
        known.axes = axes;
        known.young &= axes.moving;
        input
    }

    fn sent(&self, _: &Command<Pose>) -> InputOf<Self> {
        Input::Sent
    }

    fn acted(
        &self,
        _: &CentralMachine<Pose>,
        known: &mut Known,
        cause: CauseOf<Self>,
        action: central::Action<Pose>,
    ) {
        if let Cause::Sent(command) = cause {
            if self.keeps_rules && known.asked.is_some() {
                known.wrong = Some(ONCE);
            }
            (known.asked, known.obeyed) = (Some(command), false);
            if let Some((_, fate)) = &mut known.pending {
                if *fate != Fate::Unsent {
                    known.wrong = Some(ONCE);
                }
                *fate = Fate::Sent;
            }
        }
        let is_ended = matches!(action, central::Action::Report(Event::Closed { .. }));
        if core::mem::take(&mut known.stray) && !is_ended {
            known.wrong = Some(STRAY);
        }
        match action {
            central::Action::Nothing
            | central::Action::Sent
            | central::Action::Connected { before: None } => {}
            central::Action::Report(event) | central::Action::Connected { before: Some(event) } => {
                self.report(known, event);
            }
        }
        if matches!(cause, Cause::Connected | Cause::Disconnected) {
            (known.asked, known.has_target) = (None, false);
        }
    }

    fn tick(&self, known: &mut Known) {
        known.young = false;
    }

    fn restarted(&self, known: &mut Known) {
        (known.pending, known.asked, known.has_target) = (None, None, false);
    }

    fn broken(&self, _: &CentralMachine<Pose>, known: &Known, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
    }

    /// Returns whether each command has an outcome, which must happen whatever the device does.
    fn is_over(&self, _: &CentralMachine<Pose>, known: &Known) -> bool {
        known.pending.is_none()
    }
}

impl Wired for AnyDevice {
    type Session = Central<Pose>;

    const FAULTS: Faults = Faults { split: 0.5, ..Faults::NONE };

    fn session(&self) -> Central<Pose> {
        Central::new(self.config).expect("a configuration that works")
    }

    fn speak(&self, _: &Known, word: Word, session: &mut Central<Pose>, now: Duration) -> Vec<u8> {
        match word {
            Word::Request(command) => _ = session.request(command),
            Word::Abort => session.abort(now),
            Word::Reply(reply) => return bytes(&reply),
            Word::Corrupt => return b"Ok\r\n".into(),
            Word::Obey | Word::Rest(_) | Word::Off => return Vec::new(),
        }
        Vec::new()
    }

    fn is_written(&self, _: &SceneOf<Self>, what: &Command<Pose>, sent: &[u8]) -> bool {
        sent == bytes(what)
    }

    fn reports(&self, action: &central::Action<Pose>, reports: &mut Vec<String>) {
        match action {
            central::Action::Report(event) | central::Action::Connected { before: Some(event) } => {
                reports.extend(self.reported(event));
            }
            central::Action::Nothing
            | central::Action::Sent
            | central::Action::Connected { before: None } => {}
        }
    }

    fn reported(&self, event: &Event<Pose>) -> Option<String> {
        match event {
            Event::Connected => None,
            // The decoder's tests compare the bytes that were not understood.
            Event::Closed { reason: Closing::Malformed(_), unfinished } => {
                Some(format!("Malformed {unfinished:?}"))
            }
            event => Some(format!("{event:?}")),
        }
    }
}

impl Axes {
    fn status(self) -> Reply<Pose> {
        let Self { moving, at, servo } = self;
        Reply::Status(Status { moving, pose: at, servo, percent: 100, error: ErrorCode::None })
    }
}
