//! A device against central controllers of other makers.

use core::time::Duration;

use mmacell_proto::device::machine::{Action, Axes, DeviceLink, DeviceMachine, Input};
use mmacell_proto::{
    Command, DecodeError, Device, DeviceConfig, DeviceEvent as Event, ErrorCode, Mode, Order, Rejection,
    Reply,
};
use robot_session::end::Machine as _;

use super::world::{HOME, IN_FAULT, ONE_MOTION, PENDING, Pose, SERVO_OFF, TICK, bytes};
use crate::faults::Faults;
use crate::model::{By, Cause, CauseOf, EXPECTED, InputOf, Peer, SceneOf, Terms, WRITTEN, Wired};

const THERE: Pose = Pose::from_units([10_000, 0]);

const ASKED: &str = "nothing is asked of the owner but the command that was read last";
pub(super) const ANSWERED: &str = "each line has one answer, and nothing is sent unasked";
pub(super) const AGREED: &str = "OK: the owner has accepted; ER: it has not";

const PROPERTIES: &[&str] = &[ANSWERED, AGREED, ASKED, PENDING, IN_FAULT, SERVO_OFF, ONE_MOTION, EXPECTED];
const SHOWS: &[(&str, &str)] =
    &[("MM-3", ANSWERED), ("MM-4", ANSWERED), ("MM-18", AGREED), ("MM-20", WRITTEN)];
pub(super) const RULES: Terms = Terms {
    keeps: "MM-3, MM-4, MM-13",
    free: "which commands, when, whether it waits for the answer, on how many connections",
    shows: SHOWS,
    properties: PROPERTIES,
};
pub(super) const ANYTHING: Terms = Terms {
    keeps: "",
    free: "any line at any time, more bytes than are wanted",
    shows: SHOWS,
    properties: PROPERTIES,
};

/// A central controller of which only this is known.
#[derive(Debug, Clone, Copy)]
pub struct AnyCentral {
    /// The device's configuration.
    pub config: DeviceConfig,
    /// It sends commands of §4, the next one after the answer (MM-3, MM-4, MM-13). The commands, their times, and the
    /// number of connections are left open.
    pub keeps_rules: bool,
}

/// The model's knowledge of the line and of the owner.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Known {
    /// The line that is not answered.
    open: Open,
    /// An order of a connection before, which the owner has not answered.
    earlier: Option<Order<Pose>>,
    /// The property that is violated if the newly accepted order is carried out.
    forbids: Option<&'static str>,
    wrong: Option<&'static str>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Open {
    Nothing,
    /// A line that is not a command, or one about which the owner is not asked.
    Line {
        status: bool,
    },
    /// The owner is asked.
    Asked(Order<Pose>),
    /// The owner has answered.
    Owner {
        accepted: bool,
    },
}

/// A step of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Word {
    /// A command comes.
    Command(Command<Pose>),
    /// A line arrives that is not a command.
    Corrupt,
    /// More bytes come than fit the buffer, though the device does not read.
    Overrun,
    /// The owner accepts the order that it was asked for last, or one of a connection before.
    Accept(Order<Pose>),
    /// The owner refuses it.
    Refuse(Order<Pose>),
    /// The axes are at rest.
    Arrived,
    /// The axes fail.
    Failed,
    /// The pose of the axes becomes unknown (`None`), or known again.
    Pose(Option<Pose>),
}

const COMMANDS: [Command<Pose>; 9] = [
    Command::Status,
    Command::Move { mode: Mode::Absolute, pose: THERE },
    Command::Move { mode: Mode::Relative, pose: THERE },
    Command::Stop,
    Command::Reset,
    Command::Servo { on: true },
    Command::Servo { on: false },
    Command::Override { percent: 50 },
    Command::Close,
];

impl Peer for AnyCentral {
    type End = DeviceMachine<Pose>;
    type Known = Known;
    type Word = Word;

    const TICK: Duration = TICK;

    fn config(&self) -> &DeviceConfig {
        &self.config
    }

    fn end(&self) -> DeviceMachine<Pose> {
        DeviceMachine { pose: Some(HOME), ..DeviceMachine::NEW }
    }

    fn known(&self) -> Known {
        Known { open: Open::Nothing, earlier: None, forbids: None, wrong: None }
    }

    fn words(&self, end: &DeviceMachine<Pose>, known: &Known, words: &mut Vec<Word>) {
        if end.link != DeviceLink::Down {
            words.extend(COMMANDS.map(Word::Command));
            if !self.keeps_rules {
                words.push(if end.reads() { Word::Corrupt } else { Word::Overrun });
            }
        }
        let asked = if let Open::Asked(order) = known.open { Some(order) } else { None };
        for order in asked.into_iter().chain(known.earlier) {
            words.extend([Word::Accept(order), Word::Refuse(order)]);
        }
        if end.axes.moving() {
            words.push(Word::Arrived);
        }
        words.extend([Word::Failed, Word::Pose(end.pose.is_none().then_some(HOME))]);
    }

    fn by(&self, word: Word) -> By {
        match word {
            Word::Command(_) | Word::Corrupt => By::Line,
            // It does not wait for the end to read.
            Word::Overrun => By::Others,
            Word::Accept(_) | Word::Refuse(_) | Word::Arrived | Word::Failed | Word::Pose(_) => By::User,
        }
    }

    fn hear(&self, end: &DeviceMachine<Pose>, known: &mut Known, word: Word) -> Option<InputOf<Self>> {
        Some(match word {
            Word::Command(command) => {
                known.read(end, command == Command::Status);
                Input::Command(command)
            }
            Word::Corrupt => {
                known.read(end, false);
                Input::Corrupt(DecodeError::Incomplete)
            }
            Word::Overrun => Input::Overrun,
            Word::Accept(order) => {
                let is_pending = known.answer(end, order);
                // With the machine as it is, another one is not accepted.
                { *end }.on(TICK, Input::Accept(order), &self.config).ok()?;
                known.forbids = match (order, end.axes) {
                    _ if !is_pending => Some(PENDING),
                    (Order::Move { .. }, Axes::Fault { .. }) => Some(IN_FAULT),
                    (Order::Move { .. }, Axes::Off) => Some(SERVO_OFF),
                    (Order::Move { .. }, Axes::Moving | Axes::Stopping) => Some(ONE_MOTION),
                    _ => None,
                };
                Input::Accept(order)
            }
            Word::Refuse(order) => {
                known.answer(end, order).then_some(())?;
                Input::Refuse(order, ErrorCode::Other(77))
            }
            Word::Arrived => Input::Arrived,
            Word::Failed => Input::Failed(ErrorCode::Servo1),
            Word::Pose(pose) => Input::Pose(pose),
        })
    }

    fn sent(&self, _: &Reply<Pose>) -> InputOf<Self> {
        Input::Sent
    }

    fn acted(&self, _: &DeviceMachine<Pose>, known: &mut Known, cause: CauseOf<Self>, action: Action<Pose>) {
        let forbids = known.forbids.take();
        match (cause, action) {
            (Cause::Connected | Cause::Disconnected, _) => known.hang_up(),
            (Cause::Word(Word::Accept(_)), Action::Nothing) => {
                known.open = Open::Owner { accepted: true };
                known.wrong = known.wrong.or(forbids);
            }
            (Cause::Word(Word::Accept(_) | Word::Refuse(_)), _) => {
                known.open = Open::Owner { accepted: false }
            }
            (Cause::Word(Word::Command(_)), Action::Report(Event::Asked { order })) => {
                known.open = Open::Asked(order);
            }
            (_, Action::Report(Event::Asked { .. })) => known.wrong = Some(ASKED),
            (_, Action::Report(Event::Closed { .. })) => known.hang_up(),
            (Cause::Sent(reply), _) => known.sent(reply),
            _ => {}
        }
    }

    fn restarted(&self, known: &mut Known) {
        *known = Known { wrong: known.wrong, ..self.known() };
    }

    fn broken(&self, _: &DeviceMachine<Pose>, known: &Known, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
    }
}

impl Known {
    /// Called when a line is read.
    fn read(&mut self, end: &DeviceMachine<Pose>, status: bool) {
        if end.link == DeviceLink::Ended {
            return;
        }
        if self.open != Open::Nothing {
            self.wrong = Some(ANSWERED);
        }
        self.open = Open::Line { status };
    }

    /// Called when the owner answers an order; returns whether the order is the pending one.
    fn answer(&mut self, end: &DeviceMachine<Pose>, order: Order<Pose>) -> bool {
        if self.open != Open::Asked(order) {
            self.earlier = None;
        }
        matches!(end.link, DeviceLink::Asked { order: pending } if pending == order)
    }

    fn sent(&mut self, reply: Reply<Pose>) {
        let good = match (core::mem::replace(&mut self.open, Open::Nothing), reply) {
            (Open::Nothing | Open::Asked(_), _) => {
                self.wrong = Some(ANSWERED);
                return;
            }
            (Open::Line { status }, Reply::Status(_)) => status,
            (Open::Line { .. }, reply) => reply != Reply::Ok,
            (Open::Owner { accepted }, reply) => (reply == Reply::Ok) == accepted,
        };
        if !good {
            self.wrong = Some(AGREED);
        }
    }

    fn hang_up(&mut self) {
        if let Open::Asked(order) = self.open {
            self.earlier = Some(order);
        }
        self.open = Open::Nothing;
    }
}

impl Wired for AnyCentral {
    type Session = Device<Pose>;

    const FAULTS: Faults = Faults { split: 0.5, ..Faults::NONE };

    fn session(&self) -> Device<Pose> {
        let mut device = Device::new(self.config).expect("a configuration that works");
        device.set_pose(HOME);
        device
    }

    fn speak(&self, _: &Known, word: Word, session: &mut Device<Pose>, _: Duration) -> Vec<u8> {
        match word {
            Word::Command(command) => return bytes(&command),
            Word::Corrupt => return b"XYZ\r\n".into(),
            Word::Overrun => return vec![b'X'; 2 * Device::<Pose>::BACKLOG],
            Word::Accept(order) => _ = session.accept(order),
            Word::Refuse(order) => _ = session.refuse(order, ErrorCode::Other(77)),
            Word::Arrived => session.arrived(),
            Word::Failed => session.fail(ErrorCode::Servo1),
            Word::Pose(pose) => session.set_pose(pose.unwrap_or(Pose::from_units([i32::MAX, 0]))),
        }
        Vec::new()
    }

    fn is_written(&self, _: &SceneOf<Self>, what: &Reply<Pose>, sent: &[u8]) -> bool {
        sent == bytes(what)
    }

    fn reports(&self, action: &Action<Pose>, reports: &mut Vec<String>) {
        match action {
            Action::Report(event) => reports.extend(self.reported(event)),
            Action::Left => reports.push("Closed Agreed".into()),
            Action::Nothing | Action::Connected | Action::Sent => {}
        }
    }

    fn reported(&self, event: &Event<Pose>) -> Option<String> {
        Some(match event {
            Event::Closed { reason } => format!("Closed {reason:?}"),
            // The decoder's tests compare the bytes that were not understood.
            Event::Rejected { reason: Rejection::Malformed(_) } => "Malformed".into(),
            event => format!("{event:?}"),
        })
    }
}
