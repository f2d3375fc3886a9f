//! The device's end by itself.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "one test is over TCP")]

use core::ops::ControlFlow;
use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::thread;

use crate::common::{
    HOME, ZERO, answer, ask, central, device_at, device_with, go, obeyed, pose, receive, rejected, send,
};
use mmacell_proto::device::machine::Axes;
use mmacell_proto::robot_session::end::End as _;
use mmacell_proto::robot_session::{EndReason, Session, drive};
use mmacell_proto::{
    CentralEvent, Command, ConfigError, DecodeError, Device, DeviceClosing, DeviceConfig,
    DeviceEvent as Event, Dialect, EncodeError, ErrorCode, Line, NoPose, Order, PlatformPose, Progress,
    Rejection, RobotPose, SessionError, Status,
};

/// §4, table of examples: each command, its reply, and their meaning.
#[test]
fn the_printed_examples() {
    let pose = RobotPose::from_mm_rad(10.0, -2.0, 5.999, -1.2322);
    let mut robot = central();
    assert_eq!(send(&mut robot, ZERO, Command::Status), b"STA\r\n");
    let status = Status { moving: false, pose, servo: true, percent: 80, error: ErrorCode::None };
    assert_eq!(
        receive(&mut robot, ZERO, b"OKF+010.000-002.000+005.999-01.2322T+00080+00000\r\n"),
        CentralEvent::Status { status, motion: Progress::Still }
    );
    assert_eq!(send(&mut robot, ZERO, Command::Override { percent: 50 }), b"OVR+00050\r\n");
    let command = Command::Override { percent: 50 };
    assert_eq!(receive(&mut robot, ZERO, b"OK\r\n"), CentralEvent::Done { command });
    assert_eq!(send(&mut robot, ZERO, go(pose)), b"MOVA+010.000-002.000+005.999-01.2322\r\n");
    assert_eq!(receive(&mut robot, ZERO, b"OK\r\n"), CentralEvent::Done { command: go(pose) });

    let mut platform = device_at(PlatformPose::ORIGIN);
    assert_eq!(ask(&mut platform, "SRVON\r\n"), obeyed(Order::Servo { on: true }));
    assert_eq!(ask(&mut platform, "STP\r\n"), obeyed(Order::Stop));
    let mut robot = device_at(pose);
    ask(&mut robot, "SRVON\r\n");
    ask(&mut robot, "OVR+00080\r\n");
    let (status, order) = ask(&mut robot, "STA\r\n");
    assert_eq!(status, "OKF+010.000-002.000+005.999-01.2322T+00080+00000\r\n");
    assert_eq!(order, None);
}

/// §4.2 to §4.8, and the decisions in the type's doc where the source is open.
#[test]
fn a_device_does_what_each_command_says() {
    let mut d = device_at(HOME);
    let not_now = |state| rejected(Rejection::NotNow { state });
    let far = "MOVA+100.000+000.000+000.000+00.0000\r\n";
    assert_eq!(ask(&mut d, far), not_now("Off"));
    assert_eq!(ask(&mut d, "SRVON\r\n"), obeyed(Order::Servo { on: true }));
    assert_eq!(ask(&mut d, "OVR+00050\r\n"), obeyed(Order::Override { percent: 50 }));
    assert_eq!(ask(&mut d, far), obeyed(Order::Move { target: pose(100.0) }));
    assert_eq!(ask(&mut d, far), not_now("Moving"));
    d.set_pose(pose(60.0));
    assert_eq!(ask(&mut d, "STP\r\n"), obeyed(Order::Stop));
    assert_eq!(ask(&mut d, far), not_now("Stopping"));
    let moving = "OKT+060.000+000.000+000.000+00.0000T+00050+00000\r\n";
    assert_eq!(ask(&mut d, "STA\r\n"), (moving.into(), None));
    d.arrived();
    assert_eq!(d.machine().axes, Axes::Still);
    let relative = "MOVR-010.000+000.000+000.000+00.0000\r\n";
    assert_eq!(ask(&mut d, relative), obeyed(Order::Move { target: pose(50.0) }));
    d.set_pose(pose(50.0));
    d.arrived();
    let beyond = "MOVR+950.000+000.000+000.000+00.0000\r\n";
    assert_eq!(ask(&mut d, beyond), rejected(Rejection::OutOfRange));
    assert_eq!(ask(&mut d, "SRVOF\r\n"), obeyed(Order::Servo { on: false }));
    let off = "OKF+050.000+000.000+000.000+00.0000F+00050+00000\r\n";
    assert_eq!(ask(&mut d, "STA\r\n"), (off.into(), None));
    assert_eq!(ask(&mut d, "RST\r\n"), obeyed(Order::Home));
    assert!(d.status().unwrap().moving && d.status().unwrap().servo);
    assert_eq!(ask(&mut d, "ACQ+00002\r\n"), obeyed(Order::Acquire { camera: 2 }));
    assert_eq!(ask(&mut d, "HND+00001OPEN\r\n"), obeyed(Order::Grip { gripper: 1, open: true }));
    assert_eq!(ask(&mut d, "CLO\r\n"), obeyed(Order::Close));
    assert_eq!(d.poll_event(), Some(Event::Closed { reason: DeviceClosing::Agreed }));
    assert!(d.is_ended());
    d.handle_input(ZERO, b"STP\r\nSTP\r\n");
    assert_eq!(
        (d.poll_transmit(ZERO, &mut [0; 64]), d.poll_event()),
        (None, None),
        "the connection has ended"
    );
    d.handle_connected(ZERO);
    assert!(d.status().unwrap().moving, "the device goes on");
}

#[test]
fn a_motion_shows_before_its_ok_is_sent() {
    let mut d = device_at(HOME);
    ask(&mut d, "SRVON\r\n");
    d.handle_input(ZERO, b"MOVA+100.000+000.000+000.000+00.0000\r\n");
    let Some(Event::Asked { order }) = d.poll_event() else { panic!() };
    assert!(!d.status().unwrap().moving);
    d.accept(order).unwrap();
    assert!(d.status().unwrap().moving);
}

#[test]
fn a_device_refuses_whatever_it_likes_with_any_code() {
    let mut d = device_at(HOME);
    for line in
        ["SRVON\r\n", "OVR+00050\r\n", "RST\r\n", "STP\r\n", "CLO\r\n", "ACQ+00001\r\n", "HND+00000OPEN\r\n"]
    {
        for (error, reply) in [
            (ErrorCode::Generic, "ER+00001\r\n"),
            (ErrorCode::Other(-32_768), "ER-32768\r\n"),
            (ErrorCode::Other(4711), "ER+04711\r\n"),
        ] {
            assert_eq!(answer(&mut d, line, Some(error)).0, reply);
        }
    }
    assert_eq!(d.machine().axes, Axes::Off, "what is refused changes nothing");
    d.handle_input(ZERO, b"SRVON\r\n");
    let Some(Event::Asked { order }) = d.poll_event() else { panic!() };
    let zero = Err(SessionError::Encode(EncodeError::ErrorZero));
    assert_eq!(d.refuse(order, ErrorCode::None), zero);
    let wide = Err(SessionError::Encode(EncodeError::IntegerRange { found: 40_000 }));
    assert_eq!(d.refuse(order, ErrorCode::Other(40_000)), wide);
    assert_eq!(d.refuse(Order::Stop, ErrorCode::Generic), Err(SessionError::NotPending), "another order");
    assert_eq!(d.accept(Order::Stop), Err(SessionError::NotPending), "another order");
    assert_eq!(d.accept(order), Ok(()));
    assert_eq!(d.accept(order), Err(SessionError::NotPending), "twice");
    let config = DeviceConfig { refusal: ErrorCode::Other(77), ..DeviceConfig::DEFAULT };
    assert_eq!(ask(&mut device_with(config, HOME), "PNP\r\n").0, "ER+00077\r\n");
    for refusal in [ErrorCode::None, ErrorCode::Other(40_000)] {
        let error = Device::<RobotPose>::new(DeviceConfig { refusal, ..DeviceConfig::DEFAULT }).unwrap_err();
        assert_eq!(error, ConfigError::Refusal);
    }
}

#[test]
fn what_has_become_impossible_is_refused_also_when_it_is_accepted() {
    let mut d = device_at(HOME);
    ask(&mut d, "SRVON\r\n");
    d.handle_input(ZERO, b"MOVA+100.000+000.000+000.000+00.0000\r\n");
    let Some(Event::Asked { order }) = d.poll_event() else { panic!() };
    d.fail(ErrorCode::Servo2);
    assert_eq!(d.accept(order), Err(SessionError::NotPossible));
    assert_eq!(d.poll_event(), Some(Event::Rejected { reason: Rejection::NotNow { state: "Fault" } }));
    let mut buffer = [0; 64];
    assert_eq!(d.poll_transmit(ZERO, &mut buffer), Some(10));
    assert_eq!(&buffer[..10], b"ER+00001\r\n");
}

/// §4.1: the status holds "il numero intero che rappresenta l'errore verificatosi"
#[test]
fn an_error_stays_until_a_reset() {
    let mut d = device_at(HOME);
    ask(&mut d, "SRVON\r\n");
    ask(&mut d, "MOVA+100.000+000.000+000.000+00.0000\r\n");
    d.fail(ErrorCode::Servo1);
    d.arrived();
    let fault = "OKF+000.000+000.000+000.000+00.0000F+00100+00002\r\n";
    assert_eq!(ask(&mut d, "STA\r\n"), (fault.into(), None));
    assert_eq!(ask(&mut d, "SRVON\r\n"), rejected(Rejection::NotNow { state: "Fault" }));
    assert_eq!(ask(&mut d, "STP\r\n"), obeyed(Order::Stop));
    d.handle_connected(ZERO);
    assert_eq!(ask(&mut d, "STA\r\n").0, fault);
    assert_eq!(answer(&mut d, "RST\r\n", Some(ErrorCode::Servo1)).0, "ER+00002\r\n");
    assert_eq!(ask(&mut d, "STA\r\n").0, fault);
    assert_eq!(ask(&mut d, "RST\r\n"), obeyed(Order::Home));
    assert_eq!(d.status().unwrap().error, ErrorCode::None);
    d.arrived();
    assert_eq!(d.machine().axes, Axes::Still);
    for error in [ErrorCode::None, ErrorCode::Other(40_000)] {
        d.fail(error);
        assert_eq!(d.status().unwrap().error, ErrorCode::Generic, "a fault always shows");
    }
}

/// Unknown, malformed, for another kind of device: answered, and the next line is read.
#[test]
fn whatever_is_wrong_is_answered_with_a_generic_error() {
    let mut d = device_at(PlatformPose::ORIGIN);
    let malformed = |error| rejected(Rejection::Malformed(error));
    assert_eq!(ask(&mut d, "PNP\r\n"), malformed(DecodeError::UnknownCommand { found: *b"PNP" }));
    assert_eq!(ask(&mut d, "ITR\r\n"), malformed(DecodeError::UnknownCommand { found: *b"ITR" }));
    assert_eq!(ask(&mut d, "STAT\r\n"), malformed(DecodeError::Trailing { offset: 3 }));
    assert_eq!(
        ask(&mut d, &format!("{}\r\n", "X".repeat(200))),
        malformed(DecodeError::TooLong { limit: 64 })
    );
    let (reply, _) = ask(&mut d, "MOVA+100.000+000.000+000.000+00.0000\r\n");
    assert_eq!(reply, "ER+00001\r\n", "a robot's motion");
    assert_eq!(d.status().unwrap().error, ErrorCode::None, "a refusal is not an error of the device");
    assert_eq!(d.statistics().rejected, 5);
    let dialect = Dialect::TOLERANT;
    let config = DeviceConfig { accepts: dialect, writes: dialect, ..DeviceConfig::DEFAULT };
    let mut d = device_with(config, PlatformPose::ORIGIN);
    d.fail(ErrorCode::Other(40_000));
    assert_eq!(ask(&mut d, "STA\n").0, "OKF+00.0000+00.0000F+ 00100+ 40000\n");
    assert_eq!(ask(&mut d, "ITR\n"), ("OK\n".into(), Some(Event::Asked { order: Order::Stop })));
}

#[test]
fn a_central_controller_that_does_not_wait_loses_nothing() {
    let mut d = device_at(HOME);
    d.handle_input(ZERO, b"SRVON\r\nOVR+00010\r\nSTX\r\nSTA\r\nST");
    let (mut replies, mut orders) = (Vec::new(), Vec::new());
    for _ in 0..9 {
        while let Some(event) = d.poll_event() {
            if let Event::Asked { order } = event {
                orders.push(order);
                d.accept(order).unwrap();
            }
        }
        let mut buffer = [0; 64];
        while let Some(len) = d.poll_transmit(ZERO, &mut buffer) {
            replies.extend_from_slice(&buffer[..len]);
        }
    }
    assert_eq!(orders, [Order::Servo { on: true }, Order::Override { percent: 10 }]);
    assert_eq!(
        String::from_utf8(replies).unwrap(),
        "OK\r\nOK\r\nER+00001\r\nOKF+000.000+000.000+000.000+00.0000T+00010+00000\r\n"
    );
    d.handle_connected(ZERO);
    assert_eq!(ask(&mut d, "STP\r\n"), obeyed(Order::Stop), "the half line is forgotten");
    d.handle_input(ZERO, b"STP\r\nRST\r\nSRVON\r\n");
    assert_eq!(d.poll_event(), Some(Event::Asked { order: Order::Stop }));
    d.handle_disconnected(ZERO);
    assert_eq!(d.poll_event(), None, "what waits when it hangs up is not obeyed");
}

/// The transport buffers commands that the device does not read yet: a central controller that does not wait gets every
/// reply, in sequence.
#[test]
fn a_thousand_commands_in_one_write_are_answered_in_order() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let mut client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    let stream = listener.accept().unwrap().0;
    let device = thread::spawn(move || {
        let mut d = Device::<RobotPose>::new(DeviceConfig::DEFAULT).unwrap();
        d.set_pose(HOME);
        let ended = drive(&mut d, stream, |d, event| match event {
            Event::Asked { order } if d.accept(order).is_ok() => ControlFlow::Continue(()),
            Event::Closed { reason } => ControlFlow::Break(reason),
            other => panic!("{other:?}"),
        });
        (ended.unwrap(), d.statistics())
    });
    let commands =
        (0..1000).map(|at| if at % 3 == 0 { format!("OVR+{:05}\r\n", at % 101) } else { "STA\r\n".into() });
    let all: Vec<u8> = commands.chain(["CLO\r\n".into()]).flat_map(String::into_bytes).collect();
    let mut writer = client.try_clone().unwrap();
    let writer = thread::spawn(move || writer.write_all(&all));
    let mut replies = vec![0; 1000usize.div_ceil(3) * 4 + 666 * 50 + 4];
    client.read_exact(&mut replies).unwrap();
    let mut replies = core::str::from_utf8(&replies).unwrap().split_terminator("\r\n");
    for at in 0..1000 {
        let reply = replies.next().unwrap();
        let percent = if at % 3 == 0 { "OK".into() } else { format!("F+{:05}+00000", (at - at % 3) % 101) };
        assert!(reply.ends_with(&percent), "{at}: {reply}");
    }
    assert_eq!((replies.next(), replies.next()), (Some("OK"), None));
    writer.join().unwrap().unwrap();
    let (ended, statistics) = device.join().unwrap();
    assert_eq!(ended, EndReason::ByHandler(DeviceClosing::Agreed));
    assert_eq!((statistics.replies, statistics.rejected), (1001, 0));
}

/// However the bytes arrive, the connection ends when more wait than can be kept, and not before.
#[test]
fn more_commands_than_can_be_kept_end_the_connection() {
    let beside_a_line = Device::<RobotPose>::BACKLOG - Line::MAX_LEN;
    assert_eq!(<Device<RobotPose> as Session>::MAX_INPUT, beside_a_line);
    for size in [1, 7, 64, 4096] {
        for surplus in [0, 1] {
            let mut d = device_at(HOME);
            let mut stream = b"SRVON\r\n".to_vec();
            stream.extend(b"STA\r\n".iter().cycle().take(Device::<RobotPose>::BACKLOG + surplus));
            stream.chunks(size).for_each(|piece| d.handle_input(ZERO, piece));
            assert_eq!(d.poll_event(), Some(Event::Asked { order: Order::Servo { on: true } }));
            assert_eq!(d.is_ended(), surplus == 1, "{size}");
            let closed = Event::Closed { reason: DeviceClosing::Overrun };
            assert_eq!(d.poll_event(), (surplus == 1).then_some(closed));
            let accepted = d.accept(Order::Servo { on: true });
            assert_eq!(accepted.is_ok(), surplus == 0, "what was not answered is not carried out");
        }
    }
}

/// D-17: the first connection may be half open, and nobody knows.
#[test]
fn a_second_connection_takes_the_place_of_the_first() {
    let mut d = device_at(HOME);
    d.handle_input(ZERO, b"SRVON\r\n");
    let Some(Event::Asked { order }) = d.poll_event() else { panic!() };
    d.handle_connected(ZERO);
    assert_eq!(d.accept(order), Err(SessionError::NotPending), "its asker is gone");
    assert_eq!(d.poll_transmit(ZERO, &mut [0; 64]), None);
    d.handle_input(ZERO, b"SRVON\r\n");
    d.poll_event().unwrap();
    d.accept(order).unwrap();
    d.handle_connected(ZERO);
    assert_eq!(d.poll_transmit(ZERO, &mut [0; 64]), None, "no reply of the first is sent on the second");
    assert!(d.status().unwrap().servo, "what was accepted is done");
    assert_eq!(ask(&mut d, "STP\r\n"), obeyed(Order::Stop));
    assert_eq!((d.statistics().connections, d.statistics().lines), (3, 3));
}

/// A pose that its owner put out of range has no form: the device refuses a status instead of reporting another.
#[test]
fn a_pose_out_of_range_is_never_reported() {
    let mut d = device_at(pose(1000.0));
    assert_eq!(ask(&mut d, "STA\r\n"), rejected(Rejection::NoPose));
    assert_eq!(ask(&mut d, "MOVR+001.000+000.000+000.000+00.0000\r\n"), rejected(Rejection::NoPose));
    assert_eq!(d.status(), None);
    d.set_pose(HOME);
    assert_eq!(ask(&mut d, "STA\r\n").0, "OKF+000.000+000.000+000.000+00.0000F+00100+00000\r\n");
    let mut cameras = Device::<NoPose>::new(DeviceConfig::DEFAULT).unwrap();
    cameras.handle_connected(ZERO);
    assert_eq!(ask(&mut cameras, "STA\r\n"), rejected(Rejection::NoPose));
    assert_eq!(ask(&mut cameras, "ACQ+00001\r\n"), obeyed(Order::Acquire { camera: 1 }));
}

#[test]
fn a_buffer_that_is_too_small_changes_nothing() {
    let mut d = device_at(HOME);
    d.handle_input(ZERO, b"STA\r\n");
    for len in 0..50 {
        assert_eq!(d.poll_transmit(ZERO, &mut vec![0; len]), None);
    }
    assert_eq!(d.poll_transmit(ZERO, &mut [0; 50]), Some(50));
    assert_eq!(d.statistics().replies, 1);
    d.handle_disconnected(ZERO);
    d.handle_input(ZERO, b"STA\r\n");
    let Some(Event::Unexpected(unexpected)) = d.poll_event() else { panic!("without a connection") };
    assert_eq!(unexpected.to_string(), "Command is not expected in the state Down");
}
