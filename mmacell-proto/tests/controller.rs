//! The controller's end by itself.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod common;

use core::time::Duration;

use common::sessions::{HOME, MS, ZERO, by, closed, controller, go, hear, pose, say};
use mmacell_proto::controller::{Closing, Config, Event};
use mmacell_proto::state::{Connection, Motion};
use mmacell_proto::{
    Command, Controller, DecodeError, EncodeError, ErrorCode, NoPose, RobotPose, SessionError,
};

#[test]
fn one_command_is_outstanding_at_a_time() {
    let mut c = controller();
    say(&mut c, ZERO, Command::Stop);
    assert_eq!(c.send(Command::Status), Err(SessionError::Busy));
    assert_eq!(c.send(Command::Close), Err(SessionError::Busy));
    c.handle_input(ZERO, b"OK\r\n");
    assert_eq!(c.send(Command::Status), Err(SessionError::Busy), "the event has not been taken");
    assert_eq!(c.poll_event(), Some(Event::Done { command: Command::Stop }));
    assert_eq!(c.send(Command::Status), Ok(()));
}

#[test]
fn what_has_no_form_is_refused_and_changes_nothing() {
    let mut c = controller();
    let error = SessionError::Encode(EncodeError::AxisRange { axis: 0, found: 1_000_000 });
    assert_eq!(c.send(go(pose(1000.0))), Err(error));
    assert_eq!(c.connection(), Connection::Idle);
    assert_eq!(c.poll_transmit(ZERO, &mut [0; 64]), None);
    assert_eq!(say(&mut c, ZERO, Command::Stop), b"STP\r\n");
}

#[test]
fn a_command_goes_out_in_as_many_pieces_as_the_caller_likes() {
    let mut c = controller();
    c.send(go(pose(1.0))).unwrap();
    let mut sent = Vec::new();
    let mut buffer = [0; 7];
    assert_eq!(c.poll_transmit(ZERO, &mut []), None);
    while let Some(len) = c.poll_transmit(MS, &mut buffer) {
        sent.extend_from_slice(&buffer[..len]);
        assert_eq!(c.poll_timeout().is_some(), sent.len() == 38);
    }
    assert_eq!(sent, b"MOVA+001.000+000.000+000.000+00.0000\r\n");
    assert_eq!(c.poll_timeout(), Some(MS + Duration::from_secs(1)));
}

/// Replies have no number: one that comes too late would be taken for the next command's.
#[test]
fn silence_closes_the_session_and_the_outcome_is_unknown() {
    let mut c = controller();
    say(&mut c, MS, go(HOME));
    let deadline = MS + Duration::from_secs(1);
    assert_eq!(c.poll_timeout(), Some(deadline));
    c.handle_timeout(deadline - Duration::from_nanos(1));
    assert_eq!(c.poll_event(), None);
    c.handle_timeout(deadline);
    assert_eq!(c.poll_event(), Some(closed(Closing::Timeout, Some(go(HOME)))));
    assert_eq!(c.poll_timeout(), None);
    c.handle_input(deadline, b"OK\r\n");
    assert_eq!(c.poll_event(), None, "a closed session hears nothing");
    assert_eq!(c.send(Command::Status), Err(SessionError::Closed));
    c.handle_disconnect();
    assert_eq!(c.poll_event(), None);
}

#[test]
fn anything_but_one_good_reply_of_the_right_kind_closes_the_session() {
    let status = "OKF+000.000+000.000+000.000+00.0000T+00100+00000\r\n";
    let unexpected = |unknown| closed(Closing::Unexpected, unknown);
    let mut c = controller();
    assert_eq!(hear(&mut c, ZERO, b"OK\r\n"), unexpected(None), "nobody asked");
    let mut c = controller();
    say(&mut c, ZERO, Command::Status);
    assert_eq!(hear(&mut c, ZERO, b"OK\r\n"), unexpected(Some(Command::Status)));
    let mut c = controller();
    say(&mut c, ZERO, Command::Stop);
    assert_eq!(hear(&mut c, ZERO, status.as_bytes()), unexpected(Some(Command::Stop)));
    let mut c = controller();
    say(&mut c, ZERO, Command::Stop);
    let unknown = DecodeError::UnknownReply { found: *b"Ok" };
    assert_eq!(hear(&mut c, ZERO, b"Ok\r\n"), closed(Closing::Malformed(unknown), Some(Command::Stop)));
    let mut c = controller();
    c.send(Command::Stop).unwrap();
    c.poll_transmit(ZERO, &mut [0; 4]).unwrap();
    assert_eq!(hear(&mut c, ZERO, b"OK\r\n"), unexpected(Some(Command::Stop)), "before the question was out");
    assert_eq!(c.poll_transmit(ZERO, &mut [0; 4]), None);
    let mut c = controller();
    say(&mut c, ZERO, Command::Stop);
    c.handle_input(ZERO, b"OK\r\nOK\r\nOK\r\n");
    assert_eq!(c.poll_event(), Some(Event::Done { command: Command::Stop }));
    assert_eq!(c.poll_event(), Some(unexpected(None)));
    assert_eq!(c.poll_event(), None);
    let mut c = Controller::<NoPose>::new(Config::DEFAULT);
    say(&mut c, ZERO, Command::Status);
    c.handle_input(ZERO, b"OKF\r\n");
    let Some(Event::Closed { reason: Closing::Malformed(error), .. }) = c.poll_event() else { panic!() };
    assert_eq!(error.to_string(), "the line ends at byte 3, where no axis is expected");
}

/// §3: "Una volta finito il task il Controllore Centrale chiude la connessione"
#[test]
fn close_is_agreed_or_refused() {
    let mut c = controller();
    assert_eq!(say(&mut c, ZERO, Command::Close), b"CLO\r\n");
    let event = Event::Refused { command: Command::Close, error: ErrorCode::Other(9) };
    assert_eq!(hear(&mut c, ZERO, b"ER+00009\r\n"), event);
    assert_eq!(c.connection(), Connection::Idle);
    say(&mut c, ZERO, Command::Close);
    c.handle_input(ZERO, b"OK\r\n");
    assert_eq!(c.poll_event(), Some(Event::Done { command: Command::Close }));
    assert_eq!(c.poll_event(), Some(closed(Closing::Agreed, None)));
    assert_eq!(c.connection(), Connection::Closed);
}

fn ask(c: &mut Controller<RobotPose>, now: Duration, moving: bool, x: f64) -> Motion {
    say(c, now, Command::Status);
    let reply =
        format!("OK{}{:+08.3}+000.000+000.000+00.0000T+00100+00000\r\n", if moving { 'T' } else { 'F' }, x);
    match hear(c, now, reply.as_bytes()) {
        Event::Status { motion, status } => {
            assert_eq!((status.moving, status.pose), (moving, pose(x)));
            motion
        }
        other => panic!("{other:?}"),
    }
}

/// §4.4: `OK` says "partito". A status that comes right behind it may still be older than the motion.
#[test]
fn a_motion_has_not_ended_before_it_has_begun() {
    let started = |command, now| {
        let mut c = controller();
        assert_eq!(ask(&mut c, ZERO, false, 1.0), Motion::Still);
        say(&mut c, now, command);
        hear(&mut c, now, b"OK\r\n");
        c
    };
    let mut c = started(go(pose(5.0)), MS);
    assert_eq!(ask(&mut c, 2 * MS, false, 1.0), Motion::Starting, "too soon");
    assert_eq!(ask(&mut c, 3 * MS, true, 1.5), Motion::Moving);
    assert_eq!(ask(&mut c, 4 * MS, false, 2.0), Motion::Still, "it has been seen moving");

    let mut c = started(go(pose(5.0)), MS);
    assert_eq!(ask(&mut c, 100 * MS, false, 1.0), Motion::Starting);
    assert_eq!(ask(&mut c, 101 * MS, false, 1.0), Motion::Still, "so late it would have begun");

    let mut c = started(go(pose(5.0)), MS);
    assert_eq!(ask(&mut c, 2 * MS, false, 4.989), Motion::Starting);
    assert_eq!(ask(&mut c, 2 * MS, false, 4.99), Motion::Still, "it stands where it should");

    let mut c = started(by(pose(2.0)), MS);
    assert_eq!(ask(&mut c, 2 * MS, false, 2.0), Motion::Starting);
    assert_eq!(ask(&mut c, 2 * MS, false, 3.0), Motion::Still, "from 1 by 2");

    let mut c = started(Command::Reset, MS);
    assert_eq!(ask(&mut c, 2 * MS, false, 0.0), Motion::Starting, "nobody here knows where home is");
    assert_eq!(ask(&mut c, 101 * MS, false, 0.0), Motion::Still);

    let mut c = started(go(pose(5.0)), MS);
    say(&mut c, 2 * MS, Command::Stop);
    hear(&mut c, 2 * MS, b"OK\r\n");
    assert_eq!(c.motion(), Motion::Stopping);
    assert_eq!(ask(&mut c, 2 * MS, true, 1.2), Motion::Stopping);
    assert_eq!(ask(&mut c, 2 * MS, false, 1.2), Motion::Still, "it was told to stop");

    let mut c = started(go(pose(5.0)), MS);
    say(&mut c, 2 * MS, Command::Servo { on: false });
    hear(&mut c, 2 * MS, b"OK\r\n");
    assert_eq!(ask(&mut c, 2 * MS, false, 1.2), Motion::Still);

    let mut c = started(go(pose(5.0)), MS);
    say(&mut c, 2 * MS, by(pose(1.0)));
    hear(&mut c, 2 * MS, b"ER+00001\r\n");
    assert_eq!(ask(&mut c, 3 * MS, false, 5.0), Motion::Still, "a refused motion changes no target");
}

#[test]
fn a_relative_motion_from_nowhere_known_has_no_target() {
    let mut c = controller();
    say(&mut c, ZERO, by(pose(0.0)));
    hear(&mut c, ZERO, b"OK\r\n");
    assert_eq!(ask(&mut c, MS, false, 0.0), Motion::Starting);
    assert_eq!(ask(&mut c, 100 * MS, false, 0.0), Motion::Still);
}
