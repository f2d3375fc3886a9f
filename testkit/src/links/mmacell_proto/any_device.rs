//! A central controller against devices of other makers.

use core::time::Duration;

use mmacell_proto::central::machine::{self as central, CentralLink, CentralMachine, Input};
use mmacell_proto::{
    Central, CentralConfig, CentralEvent as Event, CloseReason, Command, DecodeError, ErrorCode, Mode,
    Progress, Reply, Status, Unfinished,
};

use super::world::{
    ARRIVED, BETWEEN, DONE, HOME, NO_BREAK, NO_TARGET, NOT_DONE, NOT_MISSED, ONCE, OUTCOME, Pose, STRAY,
    TICK, bytes,
};
use crate::faults::Faults;
use crate::model::{
    Actor, Cause, CauseOf, EXPECTED, InputOf, Peer, PeerAssumptions, SceneOf, WRITTEN, Wired,
};

const THERE: Pose = Pose::from_units([10_000, 0]);
const MOVE: Command<Pose> = Command::Move { mode: Mode::Absolute, pose: THERE };

const CLAIMED: &str = "done: the device has said so since it was asked";

pub(super) const RULES: PeerAssumptions = PeerAssumptions {
    keeps: "MM-3, MM-4, MM-18, MM-20",
    free: "when it answers and obeys, what it refuses, what stops its axes and where",
    shows: &[("MM-3", ONCE), ("MM-4", ONCE), ("MM-13", WRITTEN)],
    properties: &[OUTCOME, ONCE, CLAIMED, DONE, NOT_DONE, ARRIVED, NOT_MISSED, NO_TARGET, NO_BREAK, EXPECTED],
};
pub(super) const ANYTHING: PeerAssumptions = PeerAssumptions {
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
pub struct Knowledge {
    /// The command without an outcome for the caller, and its fate.
    pending: Option<(Command<Pose>, CommandStage)>,
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
enum CommandStage {
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
pub enum Step {
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

    fn report(&self, known: &mut Knowledge, event: Event<Pose>) {
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
                if self.keeps_rules && matches!(reason, CloseReason::Mismatch | CloseReason::Malformed(_)) {
                    known.wrong = Some(NO_BREAK);
                }
                match unfinished {
                    Unfinished::Nothing if reason == CloseReason::Agreed => (DONE, Some(Command::Close)),
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
        let has_answered = fate == CommandStage::Answered;
        if outcome == DONE && !has_answered {
            known.wrong = Some(CLAIMED);
        }
        if outcome == NOT_DONE && fate == CommandStage::Sent {
            known.wrong = Some(NOT_DONE);
        }
        if outcome == DONE && self.keeps_rules && !known.obeyed {
            known.wrong = Some(DONE);
        }
        if outcome == NOT_DONE && self.keeps_rules && known.obeyed && fate != CommandStage::Unsent {
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
    fn judge(&self, known: &mut Knowledge, status: Status<Pose>, motion: Progress) {
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
    type Knowledge = Knowledge;
    type Step = Step;

    const TICK: Duration = TICK;

    fn config(&self) -> &CentralConfig {
        &self.config
    }

    fn end(&self) -> CentralMachine<Pose> {
        CentralMachine::NEW
    }

    fn known(&self) -> Knowledge {
        let axes = Axes { moving: false, at: HOME, servo: true };
        Knowledge {
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

    fn steps(&self, end: &CentralMachine<Pose>, known: &Knowledge, steps: &mut Vec<Step>) {
        match end.link {
            CentralLink::Idle => steps.extend(REQUESTS.map(Step::Request)),
            CentralLink::Sending { .. } | CentralLink::Awaiting { .. } => steps.push(Step::Abort),
            CentralLink::Down | CentralLink::Ended => {}
        }
        if !self.keeps_rules {
            if end.link != CentralLink::Down {
                steps.extend([Reply::Ok, REFUSAL].into_iter().chain(self.statuses()).map(Step::Reply));
                steps.push(Step::Corrupt);
            }
            return;
        }
        if known.axes.moving {
            steps.extend([HOME, BETWEEN, THERE].map(Step::Rest));
        }
        if known.axes.servo {
            steps.push(Step::Off);
        }
        match known.asked {
            None => {}
            Some(Command::Status) => {
                steps.extend([known.axes.status(), REFUSAL].map(Step::Reply));
                if known.young {
                    steps.push(Step::Reply(Axes { moving: false, ..known.axes }.status()));
                }
            }
            Some(_) if known.obeyed => steps.push(Step::Reply(Reply::Ok)),
            Some(_) => steps.extend([Step::Obey, Step::Reply(REFUSAL)]),
        }
        if self.repeats && known.asked.is_some() {
            steps.push(Step::Reply(Reply::Ok));
        }
    }

    fn by(&self, step: Step) -> Actor {
        match step {
            Step::Request(_) | Step::Abort => Actor::User,
            Step::Reply(_) | Step::Corrupt => Actor::Line,
            Step::Obey | Step::Rest(_) | Step::Off => Actor::Others,
        }
    }

    fn apply(&self, end: &CentralMachine<Pose>, known: &mut Knowledge, step: Step) -> Option<InputOf<Self>> {
        let mut axes = known.axes;
        let input = match step {
            Step::Request(command) => {
                known.pending = Some((command, CommandStage::Unsent));
                Some(Input::Request(command))
            }
            Step::Abort => Some(Input::Abort),
            Step::Reply(reply) => {
                known.asked = None;
                // A device that has reported a motion does not report afterwards that it has not begun.
                known.young &= !matches!(reply, Reply::Status(status) if status.moving);
                known.stray = matches!(end.link, CentralLink::Idle | CentralLink::Sending { .. });
                let fits = matches!(end.link, CentralLink::Awaiting { .. });
                if let (Some((_, fate)), true) = (&mut known.pending, fits) {
                    *fate = CommandStage::Answered;
                }
                Some(Input::Reply(reply))
            }
            Step::Corrupt => Some(Input::Corrupt(DecodeError::Incomplete)),
            Step::Obey => {
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
            Step::Rest(at) => {
                axes = Axes { moving: false, at, ..axes };
                None
            }
            Step::Off => {
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
        known: &mut Knowledge,
        cause: CauseOf<Self>,
        action: central::Action<Pose>,
    ) {
        if let Cause::Sent(command) = cause {
            if self.keeps_rules && known.asked.is_some() {
                known.wrong = Some(ONCE);
            }
            (known.asked, known.obeyed) = (Some(command), false);
            if let Some((_, fate)) = &mut known.pending {
                if *fate != CommandStage::Unsent {
                    known.wrong = Some(ONCE);
                }
                *fate = CommandStage::Sent;
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

    fn tick(&self, known: &mut Knowledge) {
        known.young = false;
    }

    fn restarted(&self, known: &mut Knowledge) {
        (known.pending, known.asked, known.has_target) = (None, None, false);
    }

    fn broken(&self, _: &CentralMachine<Pose>, known: &Knowledge, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
    }

    /// Returns whether each command has an outcome, which must happen whatever the device does.
    fn is_over(&self, _: &CentralMachine<Pose>, known: &Knowledge) -> bool {
        known.pending.is_none()
    }
}

impl Wired for AnyDevice {
    type Session = Central<Pose>;

    const FAULTS: Faults = Faults { split: 0.5, ..Faults::NONE };

    fn session(&self) -> Central<Pose> {
        Central::new(self.config).expect("a configuration that works")
    }

    fn speak(&self, _: &Knowledge, step: Step, session: &mut Central<Pose>, now: Duration) -> Vec<u8> {
        match step {
            Step::Request(command) => _ = session.request(command),
            Step::Abort => session.abort(now),
            Step::Reply(reply) => return bytes(&reply),
            Step::Corrupt => return b"Ok\r\n".into(),
            Step::Obey | Step::Rest(_) | Step::Off => return Vec::new(),
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
            Event::Closed { reason: CloseReason::Malformed(_), unfinished } => {
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
