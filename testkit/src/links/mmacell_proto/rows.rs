//! The rows of both machines' tables: of the connection and its command, and of the subject of the command.

use core::time::Duration;

use mmacell_proto::central::machine::{
    self as central, CentralLink, CentralMachine, KnownPose, Motion, Target,
};
use mmacell_proto::device::machine::{self as device, Axes, DeviceLink, DeviceMachine};
use mmacell_proto::{
    CentralConfig, Command, DecodeError, DeviceConfig, ErrorCode, Mode, Order, PlatformPose, Reply, Status,
};
use robot_session::end::{Input as _, Machine as _};

use crate::model::{DrawnMachine, NOW, Rows};

type Pose = PlatformPose;

const HERE: Pose = PlatformPose::ORIGIN;
const THERE: Pose = PlatformPose::from_units([500, 0]);
const GO: Command<Pose> = Command::Move { mode: Mode::Absolute, pose: THERE };

fn status(moving: bool, pose: Pose, servo: bool) -> Reply<Pose> {
    Reply::Status(Status { moving, pose, servo, percent: 100, error: ErrorCode::None })
}

/// The central controller's connection, and the command on it.
#[derive(Debug)]
pub enum Central {}

impl Rows for Central {
    type Machine = CentralMachine<Pose>;

    fn states() -> Vec<Self::Machine> {
        let awaiting = |command| CentralLink::Awaiting { command, deadline: NOW };
        let links = [
            CentralLink::Down,
            CentralLink::Idle,
            CentralLink::Sending { command: GO },
            awaiting(GO),
            awaiting(Command::Status),
            awaiting(Command::Close),
            CentralLink::Ended,
        ];
        links.map(|link| CentralMachine { link, motion: Motion::NONE }).to_vec()
    }

    fn inputs() -> Vec<central::Input<Pose>> {
        use central::Input as On;
        vec![
            On::Connected,
            On::Disconnected,
            On::Timeout,
            On::Request(GO),
            On::Abort,
            On::Sent,
            On::Reply(Reply::Ok),
            On::Reply(Reply::Error { error: ErrorCode::Generic }),
            On::Reply(status(false, HERE, true)),
            On::Corrupt(DecodeError::Incomplete),
        ]
    }

    fn config() -> CentralConfig {
        CentralConfig::DEFAULT
    }

    fn row(machine: &Self::Machine, _now: Duration) -> String {
        match machine.link {
            CentralLink::Awaiting { command: Command::Status, .. } => "Awaiting, STA".into(),
            CentralLink::Awaiting { command: Command::Close, .. } => "Awaiting, CLO".into(),
            _ => machine.name().into(),
        }
    }

    fn column(input: &central::Input<Pose>) -> String {
        match input {
            central::Input::Reply(Reply::Ok) => "Reply(OK)".into(),
            central::Input::Reply(Reply::Error { .. }) => "Reply(ER)".into(),
            central::Input::Reply(Reply::Status(_)) => "Reply(status)".into(),
            _ => input.name().into(),
        }
    }
}

/// The central controller's state of the motion, with the reply to each command.
#[derive(Debug)]
pub enum Progress {}

impl Rows for Progress {
    type Machine = CentralMachine<Pose>;

    fn states() -> Vec<Self::Machine> {
        let (target, later) = (Target::At(THERE), NOW + Duration::from_secs(1));
        let motions = [
            Motion::NONE,
            Motion::Rest { target, pose: KnownPose::At(HERE) },
            Motion::Starting { target, believed_from: later },
            Motion::Starting { target: Target::Unknown, believed_from: later },
            Motion::Moving { target },
            Motion::Stopping,
        ];
        let commands = [
            GO,
            Command::Move { mode: Mode::Relative, pose: THERE },
            Command::Reset,
            Command::Stop,
            Command::Servo { on: false },
            Command::Servo { on: true },
            Command::Status,
        ];
        let state = |command, motion| CentralMachine {
            link: CentralLink::Awaiting { command, deadline: later },
            motion,
        };
        motions.into_iter().flat_map(|motion| commands.map(|command| state(command, motion))).collect()
    }

    fn inputs() -> Vec<central::Input<Pose>> {
        let statuses = [(true, HERE, true), (false, HERE, true), (false, THERE, true), (false, THERE, false)];
        let statuses = statuses.map(|(moving, pose, servo)| status(moving, pose, servo));
        [Reply::Ok].into_iter().chain(statuses).map(central::Input::Reply).collect()
    }

    fn config() -> CentralConfig {
        CentralConfig::DEFAULT
    }

    fn row(machine: &Self::Machine, _now: Duration) -> String {
        match machine.motion {
            Motion::Starting { target: Target::Unknown, .. } => "Starting, target unknown",
            Motion::Starting { .. } => "Starting",
            Motion::Moving { target: Target::Unknown } => "Moving, target unknown",
            Motion::Moving { target: Target::None } => "Moving, no target",
            Motion::Moving { target: Target::At(_) } => "Moving",
            Motion::Stopping => "Stopping",
            Motion::Rest { target: Target::None, pose: KnownPose::Unknown } => "At rest, pose unknown",
            Motion::Rest { target: Target::None, .. } => "At rest, no target",
            Motion::Rest { target: Target::Unknown, .. } => "At rest, target unknown",
            Motion::Rest { .. } => "At rest",
        }
        .into()
    }

    /// Returns the column of a reply that fits its command; empty for other inputs.
    fn column_at(machine: &Self::Machine, _now: Duration, input: &central::Input<Pose>) -> String {
        let CentralLink::Awaiting { command, .. } = machine.link else { return String::new() };
        let command = match command {
            Command::Move { mode: Mode::Absolute, .. } => "MOV",
            Command::Move { mode: Mode::Relative, .. } => "MOV, relative",
            Command::Reset => "RST",
            Command::Stop => "STP",
            Command::Servo { on: false } => "SRV, off",
            Command::Servo { on: true } => "SRV, on",
            Command::Status => "STA",
            _ => return String::new(),
        };
        match input {
            central::Input::Reply(Reply::Ok) if command != "STA" => format!("Reply(OK) to {command}"),
            central::Input::Reply(Reply::Status(status)) if command == "STA" => {
                let found = match status {
                    Status { moving: true, .. } => "moving",
                    Status { servo: false, .. } => "at the target, servo motors off",
                    Status { pose: THERE, .. } => "at the target",
                    _ => "elsewhere",
                };
                format!("Reply({found}) to STA")
            }
            _ => String::new(),
        }
    }
}

/// The device's connection, and the command on it.
#[derive(Debug)]
pub enum Device {}

impl Rows for Device {
    type Machine = DeviceMachine<Pose>;

    fn states() -> Vec<Self::Machine> {
        let links = [
            DeviceLink::Down,
            DeviceLink::Idle,
            DeviceLink::Asked { order: Order::Move { target: THERE } },
            DeviceLink::Asked { order: Order::Close },
            DeviceLink::Answering { reply: Reply::Ok },
            DeviceLink::Leaving,
            DeviceLink::Ended,
        ];
        links.map(|link| DeviceMachine { link, axes: Axes::Still, pose: Some(HERE), percent: 100 }).to_vec()
    }

    fn inputs() -> Vec<device::Input<Pose>> {
        use device::Input as On;
        let order = Order::Move { target: THERE };
        vec![
            On::Connected,
            On::Disconnected,
            On::Command(GO),
            On::Command(Command::Status),
            On::Corrupt(DecodeError::Incomplete),
            On::Overrun,
            On::Accept(order),
            On::Accept(Order::Close),
            On::Refuse(order, ErrorCode::Servo1),
            On::Sent,
            On::Pose(None),
            On::Arrived,
            On::Failed(ErrorCode::Servo1),
        ]
    }

    fn config() -> DeviceConfig {
        DeviceConfig::DEFAULT
    }

    fn row(machine: &Self::Machine, _now: Duration) -> String {
        match machine.link {
            DeviceLink::Asked { order: Order::Close } => "Asked, CLO".into(),
            _ => machine.name().into(),
        }
    }

    fn column(input: &device::Input<Pose>) -> String {
        match input {
            device::Input::Command(Command::Status) => "Command(STA)".into(),
            device::Input::Accept(Order::Close) => "Accept(CLO)".into(),
            _ => input.name().into(),
        }
    }
}

/// The device's axes, with each order.
#[derive(Debug)]
pub enum Moved {}

impl Rows for Moved {
    type Machine = DeviceMachine<Pose>;

    fn states() -> Vec<Self::Machine> {
        let axes = [Axes::Off, Axes::Still, Axes::Moving, Axes::Stopping, FAULT];
        let links = Self::inputs().into_iter().map(|input| match input {
            device::Input::Accept(order) => DeviceLink::Asked { order },
            _ => DeviceLink::Idle,
        });
        let links: Vec<_> = links.collect();
        let state = |axes| {
            let with = move |link: &DeviceLink<Pose>| DeviceMachine {
                link: *link,
                axes,
                pose: Some(HERE),
                percent: 100,
            };
            links.iter().map(with).collect::<Vec<_>>()
        };
        axes.into_iter().flat_map(state).collect()
    }

    fn inputs() -> Vec<device::Input<Pose>> {
        use device::Input as On;
        let orders = [
            Order::Servo { on: true },
            Order::Servo { on: false },
            Order::Override { percent: 1 },
            Order::Move { target: THERE },
            Order::Stop,
            Order::Home,
            Order::Close,
            Order::Acquire { camera: 1 },
            Order::Grip { gripper: 0, open: true },
        ];
        orders.map(On::Accept).into_iter().chain([On::Arrived, On::Failed(ErrorCode::Servo1)]).collect()
    }

    fn config() -> DeviceConfig {
        DeviceConfig::DEFAULT
    }

    fn row(machine: &Self::Machine, _now: Duration) -> String {
        machine.axes.name().into()
    }

    /// Returns the column of an answer to the pending order; empty for other inputs.
    fn column_at(machine: &Self::Machine, _now: Duration, input: &device::Input<Pose>) -> String {
        match (input, machine.link) {
            (device::Input::Accept(accepted), DeviceLink::Asked { order }) if *accepted == order => {
                let order = match order {
                    Order::Servo { on: true } => "SRV, on",
                    Order::Servo { on: false } => "SRV, off",
                    Order::Override { .. } => "OVR",
                    Order::Move { .. } => "MOV",
                    Order::Stop => "STP",
                    Order::Home => "RST",
                    Order::Close => "CLO",
                    Order::Acquire { .. } => "ACQ",
                    Order::Grip { .. } => "HND",
                    _ => return String::new(),
                };
                format!("Accept({order})")
            }
            (device::Input::Arrived | device::Input::Failed(_), _) => input.name().into(),
            _ => String::new(),
        }
    }
}

const FAULT: Axes = Axes::Fault { error: ErrorCode::Servo2 };

impl DrawnMachine for CentralMachine<PlatformPose> {}
impl DrawnMachine for DeviceMachine<PlatformPose> {}
