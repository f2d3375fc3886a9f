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
use crate::model::{
    Actor, Cause, CauseOf, EXPECTED, InputOf, Peer, PeerAssumptions, SceneOf, WRITTEN, Wired,
};

const THERE: Pose = Pose::from_units([10_000, 0]);

const ASKED: &str = "nothing is asked of the owner but the command that was read last";
pub(super) const ANSWERED: &str = "each line has one answer, and nothing is sent unasked";
pub(super) const AGREED: &str = "OK: the owner has accepted; ER: it has not";

const PROPERTIES: &[&str] = &[ANSWERED, AGREED, ASKED, PENDING, IN_FAULT, SERVO_OFF, ONE_MOTION, EXPECTED];
const SHOWS: &[(&str, &str)] =
    &[("MM-3", ANSWERED), ("MM-4", ANSWERED), ("MM-18", AGREED), ("MM-20", WRITTEN)];
pub(super) const RULES: PeerAssumptions = PeerAssumptions {
    keeps: "MM-3, MM-4, MM-13",
    free: "which commands, when, whether it waits for the answer, on how many connections",
    shows: SHOWS,
    properties: PROPERTIES,
};
pub(super) const ANYTHING: PeerAssumptions = PeerAssumptions {
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
pub struct Knowledge {
    /// The line that is not answered.
    open: OpenMotion,
    /// An order of a connection before, which the owner has not answered.
    earlier: Option<Order<Pose>>,
    /// The property that is violated if the newly accepted order is carried out.
    forbids: Option<&'static str>,
    wrong: Option<&'static str>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum OpenMotion {
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
pub enum Step {
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
    type Knowledge = Knowledge;
    type Step = Step;

    const TICK: Duration = TICK;

    fn config(&self) -> &DeviceConfig {
        &self.config
    }

    fn end(&self) -> DeviceMachine<Pose> {
        DeviceMachine { pose: Some(HOME), ..DeviceMachine::NEW }
    }

    fn known(&self) -> Knowledge {
        Knowledge { open: OpenMotion::Nothing, earlier: None, forbids: None, wrong: None }
    }

    fn steps(&self, end: &DeviceMachine<Pose>, known: &Knowledge, steps: &mut Vec<Step>) {
        if end.link != DeviceLink::Down {
            steps.extend(COMMANDS.map(Step::Command));
            if !self.keeps_rules {
                steps.push(if end.reads() { Step::Corrupt } else { Step::Overrun });
            }
        }
        let asked = if let OpenMotion::Asked(order) = known.open { Some(order) } else { None };
        for order in asked.into_iter().chain(known.earlier) {
            steps.extend([Step::Accept(order), Step::Refuse(order)]);
        }
        if end.axes.moving() {
            steps.push(Step::Arrived);
        }
        steps.extend([Step::Failed, Step::Pose(end.pose.is_none().then_some(HOME))]);
    }

    fn by(&self, step: Step) -> Actor {
        match step {
            Step::Command(_) | Step::Corrupt => Actor::Line,
            // It does not wait for the end to read.
            Step::Overrun => Actor::Others,
            Step::Accept(_) | Step::Refuse(_) | Step::Arrived | Step::Failed | Step::Pose(_) => Actor::User,
        }
    }

    fn apply(&self, end: &DeviceMachine<Pose>, known: &mut Knowledge, step: Step) -> Option<InputOf<Self>> {
        Some(match step {
            Step::Command(command) => {
                known.read(end, command == Command::Status);
                Input::Command(command)
            }
            Step::Corrupt => {
                known.read(end, false);
                Input::Corrupt(DecodeError::Incomplete)
            }
            Step::Overrun => Input::Overrun,
            Step::Accept(order) => {
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
            Step::Refuse(order) => {
                known.answer(end, order).then_some(())?;
                Input::Refuse(order, ErrorCode::Other(77))
            }
            Step::Arrived => Input::Arrived,
            Step::Failed => Input::Failed(ErrorCode::Servo1),
            Step::Pose(pose) => Input::Pose(pose),
        })
    }

    fn sent(&self, _: &Reply<Pose>) -> InputOf<Self> {
        Input::Sent
    }

    fn acted(
        &self,
        _: &DeviceMachine<Pose>,
        known: &mut Knowledge,
        cause: CauseOf<Self>,
        action: Action<Pose>,
    ) {
        let forbids = known.forbids.take();
        match (cause, action) {
            (Cause::Connected | Cause::Disconnected, _) => known.hang_up(),
            (Cause::Step(Step::Accept(_)), Action::Nothing) => {
                known.open = OpenMotion::Owner { accepted: true };
                known.wrong = known.wrong.or(forbids);
            }
            (Cause::Step(Step::Accept(_) | Step::Refuse(_)), _) => {
                known.open = OpenMotion::Owner { accepted: false }
            }
            (Cause::Step(Step::Command(_)), Action::Report(Event::Asked { order })) => {
                known.open = OpenMotion::Asked(order);
            }
            (_, Action::Report(Event::Asked { .. })) => known.wrong = Some(ASKED),
            (_, Action::Report(Event::Closed { .. })) => known.hang_up(),
            (Cause::Sent(reply), _) => known.sent(reply),
            _ => {}
        }
    }

    fn restarted(&self, known: &mut Knowledge) {
        *known = Knowledge { wrong: known.wrong, ..self.known() };
    }

    fn broken(&self, _: &DeviceMachine<Pose>, known: &Knowledge, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
    }
}

impl Knowledge {
    /// Called when a line is read.
    fn read(&mut self, end: &DeviceMachine<Pose>, status: bool) {
        if end.link == DeviceLink::Ended {
            return;
        }
        if self.open != OpenMotion::Nothing {
            self.wrong = Some(ANSWERED);
        }
        self.open = OpenMotion::Line { status };
    }

    /// Called when the owner answers an order; returns whether the order is the pending one.
    fn answer(&mut self, end: &DeviceMachine<Pose>, order: Order<Pose>) -> bool {
        if self.open != OpenMotion::Asked(order) {
            self.earlier = None;
        }
        matches!(end.link, DeviceLink::Asked { order: pending } if pending == order)
    }

    fn sent(&mut self, reply: Reply<Pose>) {
        let good = match (core::mem::replace(&mut self.open, OpenMotion::Nothing), reply) {
            (OpenMotion::Nothing | OpenMotion::Asked(_), _) => {
                self.wrong = Some(ANSWERED);
                return;
            }
            (OpenMotion::Line { status }, Reply::Status(_)) => status,
            (OpenMotion::Line { .. }, reply) => reply != Reply::Ok,
            (OpenMotion::Owner { accepted }, reply) => (reply == Reply::Ok) == accepted,
        };
        if !good {
            self.wrong = Some(AGREED);
        }
    }

    fn hang_up(&mut self) {
        if let OpenMotion::Asked(order) = self.open {
            self.earlier = Some(order);
        }
        self.open = OpenMotion::Nothing;
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

    fn speak(&self, _: &Knowledge, step: Step, session: &mut Device<Pose>, _: Duration) -> Vec<u8> {
        match step {
            Step::Command(command) => return bytes(&command),
            Step::Corrupt => return b"XYZ\r\n".into(),
            Step::Overrun => return vec![b'X'; 2 * Device::<Pose>::BACKLOG],
            Step::Accept(order) => _ = session.accept(order),
            Step::Refuse(order) => _ = session.refuse(order, ErrorCode::Other(77)),
            Step::Arrived => session.arrived(),
            Step::Failed => session.fail(ErrorCode::Servo1),
            Step::Pose(pose) => session.set_pose(pose.unwrap_or(Pose::from_units([i32::MAX, 0]))),
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
