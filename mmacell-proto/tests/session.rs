//! The device, and both ends over a link that splits, merges, delays and breaks.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod common;

use common::sessions::{HOME, ZERO, controller, go, hear, obeyed, pose, refused, say, tell};
use mmacell_proto::controller::{Config, Event};
use mmacell_proto::device::{Event as Order, Rejection};
use mmacell_proto::state::{Connection, ConnectionEvent, DeviceEvent, DeviceState, Motion, MotionEvent};
use mmacell_proto::{
    Command, Controller, DecodeError, Device, Dialect, ErrorCode, PlatformPose, RobotPose, Status,
};
use testkit::link::{Delivery, End, Faults, Link};

/// §4, table of examples: each command, its reply, and what it means.
#[test]
fn the_printed_examples() {
    let pose = RobotPose::from_mm_rad(10.0, -2.0, 5.999, -1.2322);
    let mut robot = controller();
    assert_eq!(say(&mut robot, ZERO, Command::Status), b"STA\r\n");
    let status = Status { moving: false, pose, servo: true, percent: 80, error: ErrorCode::None };
    assert_eq!(
        hear(&mut robot, ZERO, b"OKF+010.000-002.000+005.999-01.2322T+00080+00000\r\n"),
        Event::Status { status, motion: Motion::Still }
    );
    assert_eq!(say(&mut robot, ZERO, Command::Override { percent: 50 }), b"OVR+00050\r\n");
    let command = Command::Override { percent: 50 };
    assert_eq!(hear(&mut robot, ZERO, b"OK\r\n"), Event::Done { command });
    assert_eq!(say(&mut robot, ZERO, go(pose)), b"MOVA+010.000-002.000+005.999-01.2322\r\n");
    assert_eq!(hear(&mut robot, ZERO, b"OK\r\n"), Event::Done { command: go(pose) });
    assert_eq!(robot.motion(), Motion::Starting);

    let mut platform = Device::new(PlatformPose::ORIGIN, Dialect::STRICT);
    assert_eq!(tell(&mut platform, "SRVON\r\n"), obeyed(Order::Servo { on: true }));
    assert_eq!(tell(&mut platform, "STP\r\n"), obeyed(Order::Stop));
    let mut robot = Device::new(pose, Dialect::STRICT);
    tell(&mut robot, "SRVON\r\n");
    tell(&mut robot, "OVR+00080\r\n");
    let (status, order) = tell(&mut robot, "STA\r\n");
    assert_eq!(status, "OKF+010.000-002.000+005.999-01.2322T+00080+00000\r\n");
    assert_eq!(order, None);
}

/// §4.2 to §4.8, and what the source leaves open as the type's doc decides it.
#[test]
fn a_device_does_what_each_command_says() {
    let mut d = Device::new(HOME, Dialect::STRICT);
    let not_now = |state| refused(Rejection::NotNow(state));
    let far = "MOVA+100.000+000.000+000.000+00.0000\r\n";
    assert_eq!(tell(&mut d, far), not_now(DeviceState::Off));
    assert_eq!(tell(&mut d, "SRVON\r\n"), obeyed(Order::Servo { on: true }));
    assert_eq!(tell(&mut d, "OVR+00050\r\n"), obeyed(Order::Override { percent: 50 }));
    assert_eq!(tell(&mut d, far), obeyed(Order::Move { target: pose(100.0) }));
    assert!(d.status().moving, "the status says so before OK goes out");
    assert_eq!(tell(&mut d, far), not_now(DeviceState::Moving));
    d.set_pose(pose(60.0));
    assert_eq!(tell(&mut d, "STP\r\n"), obeyed(Order::Stop));
    assert_eq!(tell(&mut d, far), not_now(DeviceState::Stopping));
    let moving = "OKT+060.000+000.000+000.000+00.0000T+00050+00000\r\n";
    assert_eq!(tell(&mut d, "STA\r\n"), (moving.into(), None));
    d.arrived();
    assert_eq!(d.state(), DeviceState::Still);
    let relative = "MOVR-010.000+000.000+000.000+00.0000\r\n";
    assert_eq!(tell(&mut d, relative), obeyed(Order::Move { target: pose(50.0) }));
    d.set_pose(pose(50.0));
    d.arrived();
    let beyond = "MOVR+950.000+000.000+000.000+00.0000\r\n";
    assert_eq!(tell(&mut d, beyond), refused(Rejection::OutOfRange));
    assert_eq!(tell(&mut d, "SRVOF\r\n"), obeyed(Order::Servo { on: false }));
    let off = "OKF+050.000+000.000+000.000+00.0000F+00050+00000\r\n";
    assert_eq!(tell(&mut d, "STA\r\n"), (off.into(), None));
    assert_eq!(tell(&mut d, "RST\r\n"), obeyed(Order::Home));
    assert!(d.status().moving && d.status().servo);
    assert_eq!(tell(&mut d, "CLO\r\n"), obeyed(Order::Closed));
    assert_eq!(d.handle_input(ZERO, b"STP\r\nSTP\r\n"), 10);
    assert_eq!(d.poll_transmit(ZERO, &mut [0; 64]), None, "the connection is closed");
    d.connect();
    assert!(d.status().moving, "the device goes on");
}

/// §4.1: the status holds "il numero intero che rappresenta l'errore verificatosi"
#[test]
fn an_error_stays_until_a_reset() {
    let mut d = Device::new(HOME, Dialect::STRICT);
    tell(&mut d, "SRVON\r\n");
    tell(&mut d, "MOVA+100.000+000.000+000.000+00.0000\r\n");
    d.fail(ErrorCode::Servo1);
    d.arrived();
    let fault = "OKF+000.000+000.000+000.000+00.0000F+00100+00002\r\n";
    assert_eq!(tell(&mut d, "STA\r\n"), (fault.into(), None));
    assert_eq!(tell(&mut d, "SRVON\r\n"), refused(Rejection::NotNow(DeviceState::Fault)));
    assert_eq!(tell(&mut d, "STP\r\n"), obeyed(Order::Stop));
    d.connect();
    assert_eq!(tell(&mut d, "STA\r\n").0, fault);
    assert_eq!(tell(&mut d, "RST\r\n"), obeyed(Order::Home));
    assert_eq!(d.status().error, ErrorCode::None);
    d.arrived();
    assert_eq!(d.state(), DeviceState::Still);
}

/// Unknown, malformed, for another kind of device: answered, and the line behind is heard.
#[test]
fn whatever_is_wrong_is_answered_with_a_generic_error() {
    let mut d = Device::new(PlatformPose::ORIGIN, Dialect::STRICT);
    let malformed = |error| refused(Rejection::Malformed(error));
    assert_eq!(tell(&mut d, "PNP\r\n"), malformed(DecodeError::UnknownCommand { found: *b"PNP" }));
    assert_eq!(tell(&mut d, "ITR\r\n"), malformed(DecodeError::UnknownCommand { found: *b"ITR" }));
    assert_eq!(tell(&mut d, "STAT\r\n"), malformed(DecodeError::Trailing { offset: 3 }));
    assert_eq!(
        tell(&mut d, &format!("{}\r\n", "X".repeat(200))),
        malformed(DecodeError::TooLong { limit: 64 })
    );
    let (reply, _) = tell(&mut d, "MOVA+100.000+000.000+000.000+00.0000\r\n");
    assert_eq!(reply, "ER+00001\r\n", "a robot's motion");
    assert_eq!(tell(&mut d, "ACQ+00001\r\n"), refused(Rejection::NotMine));
    assert_eq!(tell(&mut d, "HND+00000OPEN\r\n"), refused(Rejection::NotMine));
    assert_eq!(d.status().error, ErrorCode::None, "a refusal is not an error of the device");
    let mut d = Device::new(PlatformPose::ORIGIN, Dialect::TOLERANT);
    assert_eq!(tell(&mut d, "ITR\n"), obeyed(Order::Stop));
}

#[test]
fn a_controller_that_does_not_wait_loses_nothing() {
    let mut d = Device::new(HOME, Dialect::STRICT);
    let mut rest: &[u8] = b"SRVON\r\nOVR+00010\r\nSTX\r\nSTA\r\nST";
    let (mut replies, mut orders) = (Vec::new(), 0);
    while !rest.is_empty() {
        let taken = d.handle_input(ZERO, rest);
        assert!(taken > 0, "nothing waits");
        rest = &rest[taken..];
        assert!(rest.is_empty() || d.handle_input(ZERO, rest) == 0, "a reply waits");
        let mut buffer = [0; 64];
        while let Some(len) = d.poll_transmit(ZERO, &mut buffer) {
            replies.extend_from_slice(&buffer[..len]);
        }
        orders += usize::from(d.poll_event().is_some());
    }
    assert_eq!(orders, 3);
    assert_eq!(
        String::from_utf8(replies).unwrap(),
        "OK\r\nOK\r\nER+00001\r\nOKF+000.000+000.000+000.000+00.0000T+00010+00000\r\n"
    );
    d.connect();
    assert_eq!(tell(&mut d, "STP\r\n"), obeyed(Order::Stop), "the half line is forgotten");
}

/// A pose that its owner put out of range cannot be told: the device says so instead of telling another.
#[test]
fn a_pose_out_of_range_is_never_told() {
    let mut d = Device::new(pose(1000.0), Dialect::STRICT);
    assert_eq!(tell(&mut d, "STA\r\n"), ("ER+00001\r\n".into(), None));
}

/// Over a link that splits, merges, delays and breaks: each motion is executed exactly once, refused, or reported as unknown,
/// and what is reported as done has been done, in this order.
#[test]
fn no_motion_is_lost_or_repeated_in_silence() {
    let mut unknowns = 0;
    let mut done_in_all = 0;
    for seed in 0..300 {
        let mut link = Link::new(seed, Faults { disconnect: 0.02, ..Faults::TCP });
        let mut controller = controller();
        let mut device = Device::new(HOME, Dialect::STRICT);
        device.set_pose(HOME);
        let mut inbox: Vec<u8> = Vec::new();
        let (mut executed, mut done, mut unknown) = (Vec::new(), Vec::new(), Vec::new());
        let mut now = ZERO;
        let mut next = 1;
        controller.send(Command::Servo { on: true }).unwrap();
        while done.len() + unknown.len() < 40 {
            let mut buffer = [0; 64];
            while let Some(len) = controller.poll_transmit(now, &mut buffer) {
                link.send(End::A, now, &buffer[..len]);
            }
            let times = [link.next_delivery(), controller.poll_timeout()];
            now = times.into_iter().flatten().min().expect("something is under way").max(now);
            controller.handle_timeout(now);
            while let Some(delivery) = link.receive(End::B, now) {
                match delivery {
                    Delivery::Bytes(bytes) => inbox.extend(bytes),
                    Delivery::Closed => inbox.clear(),
                }
            }
            while !inbox.is_empty() {
                let taken = device.handle_input(now, &inbox);
                inbox.drain(..taken);
                match device.poll_event() {
                    Some(Order::Move { target }) => {
                        executed.push(target.x.um());
                        device.set_pose(target);
                        device.arrived();
                    }
                    Some(Order::Rejected { reason }) => panic!("{reason}"),
                    _ => {}
                }
                while let Some(len) = device.poll_transmit(now, &mut buffer) {
                    link.send(End::B, now, &buffer[..len]);
                }
            }
            while let Some(delivery) = link.receive(End::A, now) {
                match delivery {
                    Delivery::Bytes(bytes) => controller.handle_input(now, &bytes),
                    Delivery::Closed => controller.handle_disconnect(),
                }
            }
            while let Some(event) = controller.poll_event() {
                match event {
                    Event::Done { command: Command::Move { pose, .. } } => done.push(pose.x.um()),
                    Event::Done { .. } => {}
                    Event::Closed { unknown: was, .. } => {
                        if let Some(Command::Move { pose, .. }) = was {
                            unknown.push(pose.x.um());
                        }
                        link.reconnect();
                        inbox.clear();
                        device.connect();
                        controller = Controller::new(Config::DEFAULT);
                    }
                    other => panic!("{other:?}"),
                }
            }
            if controller.connection() == Connection::Idle {
                let servo = device.status().servo;
                controller
                    .send(if servo { go(pose(f64::from(next))) } else { Command::Servo { on: true } })
                    .unwrap();
                next += i32::from(servo);
            }
        }
        let told: Vec<i32> = (1..next).map(|n| n * 1000).collect();
        let certain: Vec<i32> = executed.iter().copied().filter(|x| !unknown.contains(x)).collect();
        assert_eq!(certain, done, "seed {seed}");
        assert!(executed.windows(2).all(|pair| pair[0] < pair[1]), "seed {seed}: {executed:?}");
        assert!(
            told.iter().filter(|x| !done.contains(x) && !unknown.contains(x)).count() <= 1,
            "seed {seed}"
        );
        unknowns += unknown.len();
        done_in_all += done.len();
    }
    assert!(unknowns > 50 && done_in_all > 10_000, "{unknowns} unknown, {done_in_all} done");
}

/// Every state with every event; `–` where the caller or the controller is refused.
#[test]
fn the_state_matrix_is_the_committed_one() {
    let mut matrix = String::new();
    let mut row = |state: String, cells: Vec<String>| {
        matrix.push_str(&format!(
            "{state:<12}{}\n",
            cells.iter().map(|c| format!("{c:<18}")).collect::<String>().trim_end()
        ));
    };
    let cell = |next: Option<String>| next.unwrap_or_else(|| "–".into());
    row("Connection".into(), ConnectionEvent::ALL.iter().map(|e| format!("{e:?}")).collect());
    for state in Connection::ALL {
        let next = |e: &ConnectionEvent| cell(state.next(*e).map(|s| format!("{s:?}")));
        row(format!("{state:?}"), ConnectionEvent::ALL.iter().map(next).collect());
    }
    row("Motion".into(), MotionEvent::ALL.iter().map(|e| format!("{e:?}")).collect());
    for state in Motion::ALL {
        row(format!("{state:?}"), MotionEvent::ALL.iter().map(|e| format!("{:?}", state.next(*e))).collect());
    }
    row("Device".into(), DeviceEvent::ALL.iter().map(|e| format!("{e:?}")).collect());
    for state in DeviceState::ALL {
        let next = |e: &DeviceEvent| cell(state.next(*e).map(|s| format!("{s:?}")));
        row(format!("{state:?}"), DeviceEvent::ALL.iter().map(next).collect());
    }
    assert_eq!(matrix, include_str!("state_matrix.txt"), "\n{matrix}");
}
