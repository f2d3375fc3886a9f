//! The device's counters and limits, and the printed examples.
//! Its rules are the stories of `reference/sessions/mmacell-proto.json`.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "one test is over TCP")]

use core::ops::ControlFlow;
use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::thread;

use crate::common::{HOME, ZERO, ask, central, device_at, device_with, go, obeyed, receive, rejected, send};
use mmacell_proto::robot_session::{EndReason, Session, drive};
use mmacell_proto::{
    CentralEvent, Command, DecodeError, Device, DeviceClosing, DeviceConfig, DeviceEvent as Event, Dialect,
    ErrorCode, Line, Order, PlatformPose, Progress, Rejection, RobotPose, SessionError, Status,
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
