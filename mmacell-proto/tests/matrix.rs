//! Every state of each machine with every input.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use core::fmt::Write;
use core::time::Duration;

use mmacell_proto::central::machine::{CentralInput, CentralLink, CentralMachine, Motion, Place, Target};
use mmacell_proto::device::machine::{Axes, DeviceInput, DeviceLink, DeviceMachine};
use mmacell_proto::{
    CentralConfig, Command, DecodeError, DeviceConfig, ErrorCode, Mode, Order, PlatformPose, Reply, Status,
};

const HERE: PlatformPose = PlatformPose::ORIGIN;
const THERE: PlatformPose = PlatformPose::from_units([500, 0]);
const GO: Command<PlatformPose> = Command::Move { mode: Mode::Absolute, pose: THERE };

fn status(moving: bool, pose: PlatformPose, servo: bool) -> Reply<PlatformPose> {
    Reply::Status(Status { moving, pose, servo, percent: 100, error: ErrorCode::None })
}

fn short(value: impl core::fmt::Debug) -> String {
    format!("{value:?}")
        .replace("PlatformPose { a: Angle(0), b: Angle(0) }", "here")
        .replace("PlatformPose { a: Angle(500), b: Angle(0) }", "there")
}

#[test]
fn the_state_matrix_is_the_committed_one() {
    let mut text = String::from("Central: the connection, and the command on it\n\n");
    let deadline = Duration::from_secs(1);
    for link in [
        CentralLink::Down,
        CentralLink::Idle,
        CentralLink::Sending { command: GO },
        CentralLink::Awaiting { command: GO, deadline },
        CentralLink::Awaiting { command: Command::Status, deadline },
        CentralLink::Awaiting { command: Command::Close, deadline },
        CentralLink::Ended,
    ] {
        let machine = CentralMachine { link, motion: Motion::NONE };
        writeln!(text, "{}", short(link)).unwrap();
        for input in [
            CentralInput::Connected,
            CentralInput::Disconnected,
            CentralInput::Request(GO),
            CentralInput::Abort,
            CentralInput::Transmit,
            CentralInput::Reply(Reply::Ok),
            CentralInput::Reply(Reply::Error { error: ErrorCode::Generic }),
            CentralInput::Reply(status(false, HERE, true)),
            CentralInput::Corrupt(DecodeError::Incomplete),
            CentralInput::Due,
        ] {
            central(&mut text, machine, input, deadline, |machine| short(machine.link));
        }
    }
    text.push_str("\nCentral: the motion\n\n");
    let target = Target::At(THERE);
    for motion in [
        Motion::NONE,
        Motion::Rest { target, pose: Place::At(HERE) },
        Motion::Starting { target, believed_from: deadline },
        Motion::Starting { target, believed_from: Duration::ZERO },
        Motion::Starting { target: Target::Unknown, believed_from: Duration::ZERO },
        Motion::Moving { target },
        Motion::Stopping,
    ] {
        writeln!(text, "{}", short(motion)).unwrap();
        for command in [
            GO,
            Command::Move { mode: Mode::Relative, pose: THERE },
            Command::Reset,
            Command::Stop,
            Command::Servo { on: false },
            Command::Servo { on: true },
        ] {
            let machine = CentralMachine { link: CentralLink::Awaiting { command, deadline }, motion };
            let input = CentralInput::Reply(Reply::Ok);
            central(&mut text, machine, input, Duration::ZERO, |machine| short(machine.motion));
        }
        for (moving, pose, servo) in
            [(true, HERE, true), (false, HERE, true), (false, THERE, true), (false, THERE, false)]
        {
            let command = Command::Status;
            let machine = CentralMachine { link: CentralLink::Awaiting { command, deadline }, motion };
            let input = CentralInput::Reply(status(moving, pose, servo));
            central(&mut text, machine, input, Duration::ZERO, |machine| short(machine.motion));
        }
    }
    text.push_str("\nDevice: the connection, and the command on it\n\n");
    let order = Order::Move { target: THERE };
    for link in [
        DeviceLink::Down,
        DeviceLink::Idle,
        DeviceLink::Asked { order },
        DeviceLink::Asked { order: Order::Close },
        DeviceLink::Answering { reply: Reply::Ok },
        DeviceLink::Leaving,
        DeviceLink::Ended,
    ] {
        let machine = DeviceMachine { link, axes: Axes::Still, pose: Some(HERE), percent: 100 };
        writeln!(text, "{}", short(link)).unwrap();
        for input in [
            DeviceInput::Connected,
            DeviceInput::Disconnected,
            DeviceInput::Command(GO),
            DeviceInput::Command(Command::Status),
            DeviceInput::Corrupt(DecodeError::Incomplete),
            DeviceInput::Overrun,
            DeviceInput::Accept(order),
            DeviceInput::Accept(Order::Close),
            DeviceInput::Refuse(order, ErrorCode::Servo1),
            DeviceInput::Transmit,
            DeviceInput::Pose(None),
            DeviceInput::Arrived,
            DeviceInput::Failed(ErrorCode::Servo1),
        ] {
            device(&mut text, machine, input, |machine| short(machine.link));
        }
    }
    text.push_str("\nDevice: the axes\n\n");
    for axes in
        [Axes::Off, Axes::Still, Axes::Moving, Axes::Stopping, Axes::Fault { error: ErrorCode::Servo2 }]
    {
        writeln!(text, "{axes:?}").unwrap();
        for order in [
            Order::Servo { on: true },
            Order::Servo { on: false },
            Order::Override { percent: 1 },
            order,
            Order::Stop,
            Order::Home,
            Order::Close,
            Order::Acquire { camera: 1 },
            Order::Grip { gripper: 0, open: true },
        ] {
            let link = DeviceLink::Asked { order };
            let machine = DeviceMachine { link, axes, pose: Some(HERE), percent: 100 };
            device(&mut text, machine, DeviceInput::Accept(order), |machine| short(machine.axes));
        }
        let machine = DeviceMachine { link: DeviceLink::Idle, axes, pose: Some(HERE), percent: 100 };
        device(&mut text, machine, DeviceInput::Arrived, |machine| short(machine.axes));
        device(&mut text, machine, DeviceInput::Failed(ErrorCode::Servo1), |machine| short(machine.axes));
    }
    if std::env::var_os("WRITE_MATRIX").is_some() {
        std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/state_matrix.txt"), &text).unwrap();
    }
    assert_eq!(text, include_str!("state_matrix.txt"), "\n{text}");
}

fn central(
    text: &mut String,
    mut machine: CentralMachine<PlatformPose>,
    input: CentralInput<PlatformPose>,
    now: Duration,
    what: impl Fn(&CentralMachine<PlatformPose>) -> String,
) {
    let before = machine;
    let action = machine.on(now, input, &CentralConfig::DEFAULT);
    let cell = match action {
        Ok(action) => format!("{}, {}", what(&machine), short(action)),
        Err(_) => {
            assert_eq!(machine, before, "nothing has changed");
            "unexpected".into()
        }
    };
    let CentralLink::Awaiting { command, .. } = before.link else {
        writeln!(text, "    {} → {cell}", short(input)).unwrap();
        return;
    };
    writeln!(text, "    {} to {} → {cell}", short(input), short(command)).unwrap();
}

fn device(
    text: &mut String,
    mut machine: DeviceMachine<PlatformPose>,
    input: DeviceInput<PlatformPose>,
    what: impl Fn(&DeviceMachine<PlatformPose>) -> String,
) {
    let before = machine;
    let cell = match machine.on(input, &DeviceConfig::DEFAULT) {
        Ok(action) => format!("{}, {}", what(&machine), short(action)),
        Err(_) => {
            assert_eq!(machine, before, "nothing has changed");
            "unexpected".into()
        }
    };
    writeln!(text, "    {} → {cell}", short(input)).unwrap();
}
