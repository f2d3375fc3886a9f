//! The central controller's end by itself.

use core::time::Duration;

use crate::common::{HOME, MS, ZERO, by, central, central_with, closed, connect, go, pose, receive, send};
use mmacell_proto::robot_session::Session as _;
use mmacell_proto::{
    Central, CentralConfig, CentralEvent as Event, CloseReason, Command, ConfigError, DecodeError, Dialect,
    EncodeError, ErrorCode, MissReason, NoPose, Progress, RobotPose, SessionError, Status, Unfinished,
};

const S: Duration = Duration::from_secs(1);

#[test]
fn one_command_is_outstanding_at_a_time() {
    let mut c = central();
    send(&mut c, ZERO, Command::Stop);
    assert_eq!(c.request(Command::Status), Err(SessionError::Busy));
    assert_eq!(c.request(Command::Close), Err(SessionError::Busy));
    assert!(!c.is_idle());
    assert_eq!(receive(&mut c, ZERO, b"OK\r\n"), Event::Done { command: Command::Stop });
    assert!(c.is_idle());
    assert_eq!(c.request(Command::Status), Ok(()));
}

#[test]
fn nothing_is_requested_while_an_outcome_waits() {
    let mut c = central();
    send(&mut c, ZERO, Command::Stop);
    c.handle_input(ZERO, b"OK\r\n");
    assert!(!c.is_idle());
    assert_eq!(c.request(Command::Stop), Err(SessionError::Busy), "the outcome of the last one waits");
    assert_eq!(c.poll_event(), Some(Event::Done { command: Command::Stop }));
    assert!(c.is_idle());
    send(&mut c, ZERO, Command::Stop);
    c.handle_connected(ZERO);
    assert_eq!(c.request(Command::Stop), Err(SessionError::Busy), "the end of the connection before waits");
    assert_eq!(c.poll_event(), Some(closed(CloseReason::Disconnected, Unfinished::Unknown(Command::Stop))));
    assert_eq!(c.request(Command::Stop), Ok(()), "a notice may wait");
    assert_eq!(c.poll_event(), Some(Event::Connected));
}

#[test]
fn no_connection_is_begun_while_there_is_no_room_for_its_outcomes() {
    let mut c = central();
    for _ in 0..5 {
        c.handle_connected(ZERO);
    }
    let closing = closed(CloseReason::Disconnected, Unfinished::Nothing);
    let waiting: Vec<_> = core::iter::from_fn(|| c.poll_event()).collect();
    assert_eq!(waiting, [closing; 4], "of the connections that were begun");
    assert_eq!(c.request(Command::Stop), Err(SessionError::NotConnected), "the last one was not");
    connect(&mut c);
    assert_eq!(c.request(Command::Stop), Ok(()));
}

#[test]
fn what_has_no_form_is_refused_and_changes_nothing() {
    let mut c = central();
    let error = SessionError::Encode(EncodeError::AxisRange { axis: 0, found: 1_000_000 });
    assert_eq!(c.request(go(pose(1000.0))), Err(error));
    assert!(c.is_idle());
    assert_eq!(c.poll_transmit(ZERO, &mut [0; 64]), None);
    assert_eq!(send(&mut c, ZERO, Command::Stop), b"STP\r\n");
}

#[test]
fn a_buffer_that_is_too_small_changes_nothing() {
    let mut c = central();
    c.request(go(pose(1.0))).unwrap();
    for len in 0..38 {
        assert_eq!(c.poll_transmit(ZERO, &mut vec![0; len]), None);
        assert_eq!(c.poll_timeout(), None, "it is not sent");
    }
    let mut buffer = [0; 38];
    assert_eq!(c.poll_transmit(MS, &mut buffer), Some(38));
    assert_eq!(&buffer, b"MOVA+001.000+000.000+000.000+00.0000\r\n");
    assert_eq!(c.poll_timeout(), Some(MS + S));
}

/// Replies have no number: one that comes too late would be taken for the next command's.
#[test]
fn silence_ends_the_connection_and_the_outcome_is_unknown() {
    let mut c = central();
    send(&mut c, MS, go(HOME));
    let deadline = MS + S;
    assert_eq!(c.poll_timeout(), Some(deadline));
    c.handle_timeout(deadline - Duration::from_nanos(1));
    assert_eq!(c.poll_event(), None);
    c.handle_timeout(deadline);
    assert_eq!(c.poll_event(), Some(closed(CloseReason::Timeout, Unfinished::Unknown(go(HOME)))));
    assert_eq!(c.poll_timeout(), None);
    assert!(c.is_ended());
    c.handle_input(deadline, b"OK\r\n");
    assert_eq!(c.poll_event(), None, "what arrives after the end means nothing");
    assert_eq!(c.request(Command::Status), Err(SessionError::NotConnected));
    c.handle_disconnected(deadline);
    assert_eq!(c.poll_event(), None, "a connection ends once");
    connect(&mut c);
    assert_eq!(send(&mut c, deadline, Command::Status), b"STA\r\n");
    assert_eq!(c.statistics().unknown, 1);
}

#[test]
fn a_timeout_for_ever_saturates() {
    let mut c: Central<RobotPose> =
        central_with(CentralConfig { timeout: Duration::MAX, ..CentralConfig::DEFAULT });
    send(&mut c, S, Command::Stop);
    assert_eq!(c.poll_timeout(), None);
    c.handle_timeout(Duration::MAX - MS);
    assert_eq!(c.poll_event(), None);
    c.handle_input(Duration::MAX, b"OK\r\n");
    assert_eq!(c.poll_event(), Some(Event::Done { command: Command::Stop }));
    // At the end of time, and with a motion that is never believed to have begun.
    let config = CentralConfig { settle: Duration::MAX, tolerance: u32::MAX, ..CentralConfig::DEFAULT };
    let mut c: Central<RobotPose> = central_with(config);
    send(&mut c, Duration::MAX, go(HOME));
    assert_eq!(c.poll_timeout(), None);
    c.handle_input(Duration::MAX, b"OK\r\n");
    assert_eq!(c.poll_event(), Some(Event::Done { command: go(HOME) }));
    c.handle_connected(Duration::MAX);
    c.handle_disconnected(Duration::MAX);
    c.abort(Duration::MAX);
    let config = CentralConfig { timeout: ZERO, ..CentralConfig::DEFAULT };
    assert_eq!(Central::<RobotPose>::new(config).unwrap_err(), ConfigError::Timeout);
}

#[test]
fn anything_but_one_good_reply_of_the_right_kind_ends_the_connection() {
    let status = "OKF+000.000+000.000+000.000+00.0000T+00100+00000\r\n";
    let mismatch = |unfinished| closed(CloseReason::Mismatch, unfinished);
    let mut c = central();
    assert_eq!(receive(&mut c, ZERO, b"OK\r\n"), mismatch(Unfinished::Nothing), "unsolicited");
    let mut c = central();
    send(&mut c, ZERO, Command::Status);
    assert_eq!(receive(&mut c, ZERO, b"OK\r\n"), mismatch(Unfinished::Unknown(Command::Status)));
    let mut c = central();
    send(&mut c, ZERO, Command::Stop);
    assert_eq!(receive(&mut c, ZERO, status.as_bytes()), mismatch(Unfinished::Unknown(Command::Stop)));
    let mut c = central();
    send(&mut c, ZERO, Command::Stop);
    let malformed = CloseReason::Malformed(DecodeError::UnknownReply { found: *b"Ok" });
    assert_eq!(receive(&mut c, ZERO, b"Ok\r\n"), closed(malformed, Unfinished::Unknown(Command::Stop)));
    let mut c = central();
    c.request(Command::Stop).unwrap();
    assert_eq!(receive(&mut c, ZERO, b"OK\r\n"), mismatch(Unfinished::NotSent(Command::Stop)));
    assert_eq!(c.poll_transmit(ZERO, &mut [0; 64]), None);
    let mut c = central();
    send(&mut c, ZERO, Command::Stop);
    c.handle_input(ZERO, b"OK\r\nOK\r\nOK\r\n");
    assert_eq!(c.poll_event(), Some(Event::Done { command: Command::Stop }));
    assert_eq!(c.poll_event(), Some(mismatch(Unfinished::Nothing)));
    assert_eq!(c.poll_event(), None);
    let mut c = central_with::<NoPose>(CentralConfig::DEFAULT);
    send(&mut c, ZERO, Command::Status);
    c.handle_input(ZERO, b"OKF\r\n");
    let Some(Event::Closed { reason: CloseReason::Malformed(error), .. }) = c.poll_event() else { panic!() };
    assert_eq!(error.to_string(), "the line ends at byte 3, where no axis is expected");
}

#[test]
fn nothing_of_a_connection_leaks_into_the_next() {
    let mut c = central();
    send(&mut c, ZERO, go(pose(5.0)));
    c.handle_input(ZERO, b"OK\r\nER+00");
    assert_eq!(c.poll_event(), Some(Event::Done { command: go(pose(5.0)) }));
    send(&mut c, ZERO, Command::Status);
    let before = closed(CloseReason::Disconnected, Unfinished::Unknown(Command::Status));
    assert_eq!(connect(&mut c), Some(before));
    assert_eq!(query(&mut c, ZERO, false, 1.0, true), Progress::Still, "neither half a line nor a target");
    c.handle_disconnected(ZERO);
    assert_eq!(c.poll_event(), Some(closed(CloseReason::Disconnected, Unfinished::Nothing)));
    c.handle_input(ZERO, b"OK\r\n");
    let Some(Event::Unexpected(unexpected)) = c.poll_event() else { panic!("without a connection") };
    assert_eq!(unexpected.to_string(), "Reply is not expected in the state Down");
    assert_eq!(c.statistics().unexpected, 1);
}

#[test]
fn a_command_is_aborted_before_and_after_it_is_sent() {
    let mut c = central();
    c.abort(ZERO);
    assert_eq!(c.poll_event(), None, "there is nothing to abort");
    c.request(go(pose(1.0))).unwrap();
    c.abort(ZERO);
    assert_eq!(c.poll_event(), Some(Event::Aborted { command: go(pose(1.0)) }));
    assert_eq!(c.poll_transmit(ZERO, &mut [0; 64]), None, "it is never sent");
    send(&mut c, ZERO, go(pose(2.0)));
    c.abort(ZERO);
    assert_eq!(c.poll_event(), Some(closed(CloseReason::Aborted, Unfinished::Unknown(go(pose(2.0))))));
    assert!(c.is_ended());
}

/// §3: "Una volta finito il task il Controllore Centrale chiude la connessione"
#[test]
fn close_is_agreed_or_refused() {
    let mut c = central();
    assert_eq!(send(&mut c, ZERO, Command::Close), b"CLO\r\n");
    let event = Event::Refused { command: Command::Close, error: ErrorCode::Other(9) };
    assert_eq!(receive(&mut c, ZERO, b"ER+00009\r\n"), event);
    assert!(c.is_idle());
    send(&mut c, ZERO, Command::Close);
    assert_eq!(receive(&mut c, ZERO, b"OK\r\n"), closed(CloseReason::Agreed, Unfinished::Nothing));
    assert!(c.is_ended());
}

#[test]
fn a_dialect_is_written_as_well_as_read() {
    let dialect = Dialect::TOLERANT;
    let config = CentralConfig { accepts: dialect, writes: dialect, ..CentralConfig::DEFAULT };
    let mut c = central_with::<RobotPose>(config);
    for (command, line) in [
        (Command::Stop, "ITR\n"),
        (Command::Servo { on: false }, "SRVOFF\n"),
        (Command::Override { percent: 50 }, "OVRD+ 00050\n"),
        (Command::Grip { gripper: -1, open: false }, "HND- 00001CLOS\n"),
        (Command::Acquire { camera: 99_999 }, "ACQ+ 99999\n"),
    ] {
        assert_eq!(String::from_utf8(send(&mut c, ZERO, command)).unwrap(), line);
        let event = Event::Refused { command, error: ErrorCode::Other(40_000) };
        assert_eq!(receive(&mut c, ZERO, b"ER+ 40000\n"), event);
    }
}

fn query(c: &mut Central<RobotPose>, now: Duration, moving: bool, x: f64, servo: bool) -> Progress {
    send(c, now, Command::Status);
    let flag = |flag| if flag { 'T' } else { 'F' };
    let (moves, on) = (flag(moving), flag(servo));
    let reply = format!("OK{moves}{x:+08.3}+000.000+000.000+00.0000{on}+00100+00000\r\n");
    match receive(c, now, reply.as_bytes()) {
        Event::Status { motion, status } => {
            let percent = 100;
            assert_eq!(status, Status { moving, pose: pose(x), servo, percent, error: ErrorCode::None });
            motion
        }
        other => panic!("{other:?}"),
    }
}

fn started(command: Command<RobotPose>, now: Duration) -> Central<RobotPose> {
    let mut c = central();
    assert_eq!(query(&mut c, ZERO, false, 1.0, true), Progress::Still);
    send(&mut c, now, command);
    receive(&mut c, now, b"OK\r\n");
    c
}

/// §4.4: `OK` says "partito". A status that comes right after it may still be older than the motion.
#[test]
fn a_motion_has_not_ended_before_it_has_begun() {
    let mut c = started(go(pose(5.0)), MS);
    assert_eq!(query(&mut c, 2 * MS, false, 1.0, true), Progress::Starting, "too soon");
    assert_eq!(query(&mut c, 3 * MS, true, 1.5, true), Progress::Moving);
    assert_eq!(query(&mut c, 4 * MS, true, 5.0, true), Progress::Moving, "it passes its target");
    assert_eq!(query(&mut c, 5 * MS, false, 5.0, true), Progress::Arrived);

    let mut c = started(go(pose(5.0)), MS);
    assert_eq!(query(&mut c, 100 * MS, false, 1.0, true), Progress::Starting);
    assert_eq!(
        query(&mut c, 101 * MS, false, 1.0, true),
        Progress::Missed(MissReason::Elsewhere),
        "it never began"
    );

    // A status that was asked for too soon is not believed, however late it arrives.
    let mut c = started(go(pose(5.0)), MS);
    send(&mut c, 100 * MS, Command::Status);
    let late = receive(&mut c, 900 * MS, b"OKF+001.000+000.000+000.000+00.0000T+00100+00000\r\n");
    assert!(matches!(late, Event::Status { motion: Progress::Starting, .. }), "{late:?}");

    let mut c = started(go(pose(5.0)), MS);
    assert_eq!(query(&mut c, 2 * MS, false, 4.99, true), Progress::Arrived, "sooner than anybody asked");
}

/// A device that is at rest has arrived only at its target, and only with its servo motors on.
#[test]
fn at_rest_is_not_arrived() {
    let missed = Progress::Missed;
    let mut c = started(go(pose(5.0)), MS);
    query(&mut c, 2 * MS, true, 2.0, true);
    assert_eq!(query(&mut c, 3 * MS, false, 2.0, true), missed(MissReason::Elsewhere), "it stopped half-way");
    assert_eq!(query(&mut c, 4 * MS, false, 4.989, true), missed(MissReason::Elsewhere), "11 µm");
    assert_eq!(query(&mut c, 4 * MS, false, 5.011, true), missed(MissReason::Elsewhere), "11 µm");
    assert_eq!(query(&mut c, 4 * MS, false, 5.010, true), Progress::Arrived, "10 µm");
    assert_eq!(query(&mut c, 5 * MS, false, 5.0, false), missed(MissReason::ServoOff));
    assert_eq!(query(&mut c, 5 * MS, true, 6.0, true), Progress::Moving, "somebody else moves it");
    assert_eq!(
        query(&mut c, 5 * MS, false, 6.0, true),
        missed(MissReason::Elsewhere),
        "away from its target"
    );
}

#[test]
fn a_relative_motion_leads_from_where_the_device_rested() {
    let mut c = started(by(pose(2.0)), MS);
    assert_eq!(query(&mut c, 2 * MS, false, 2.0, true), Progress::Starting);
    assert_eq!(query(&mut c, 2 * MS, false, 3.0, true), Progress::Arrived, "from 1 by 2");
    send(&mut c, MS, by(pose(999.0)));
    receive(&mut c, MS, b"OK\r\n");
    query(&mut c, MS, true, 3.0, true);
    assert_eq!(query(&mut c, MS, false, 3.0, true), Progress::Still, "nobody knows where that leads");
    let mut c = central();
    send(&mut c, ZERO, by(pose(0.0)));
    receive(&mut c, ZERO, b"OK\r\n");
    assert_eq!(query(&mut c, MS, false, 0.0, true), Progress::Starting);
    assert_eq!(query(&mut c, 100 * MS, false, 0.0, true), Progress::Still, "from nowhere known");
    // A pose that was seen in motion is none to add to.
    let mut c = started(go(pose(5.0)), MS);
    query(&mut c, 2 * MS, true, 3.0, true);
    send(&mut c, 2 * MS, by(pose(1.0)));
    receive(&mut c, 2 * MS, b"OK\r\n");
    assert_eq!(query(&mut c, 200 * MS, false, 6.0, true), Progress::Still);
}

#[test]
fn after_a_reset_only_the_device_knows_where_home_is() {
    let mut c = started(Command::Reset, MS);
    assert_eq!(query(&mut c, 2 * MS, false, 0.0, true), Progress::Starting);
    assert_eq!(query(&mut c, 101 * MS, false, 0.0, false), Progress::Missed(MissReason::ServoOff));
    assert_eq!(query(&mut c, 101 * MS, false, 0.0, true), Progress::Still);
}

#[test]
fn a_halt_ends_the_motion_and_its_target() {
    let halted = |halt| {
        let mut c = started(go(pose(5.0)), MS);
        send(&mut c, 2 * MS, halt);
        receive(&mut c, 2 * MS, b"OK\r\n");
        c
    };
    let mut c = halted(Command::Stop);
    assert_eq!(query(&mut c, 2 * MS, true, 1.2, true), Progress::Stopping);
    assert_eq!(query(&mut c, 2 * MS, false, 1.2, true), Progress::Still);
    let mut c = halted(Command::Servo { on: false });
    assert_eq!(query(&mut c, 2 * MS, false, 1.2, false), Progress::Still);
    let mut c = started(go(pose(5.0)), MS);
    query(&mut c, 2 * MS, false, 5.0, true);
    send(&mut c, 2 * MS, Command::Stop);
    receive(&mut c, 2 * MS, b"OK\r\n");
    assert_eq!(query(&mut c, 2 * MS, false, 1.2, true), Progress::Still, "also one that has ended");
    let mut c = started(go(pose(5.0)), MS);
    send(&mut c, 2 * MS, by(pose(1.0)));
    receive(&mut c, 2 * MS, b"ER+00001\r\n");
    assert_eq!(
        query(&mut c, 3 * MS, false, 5.0, true),
        Progress::Arrived,
        "a refused motion changes no target"
    );
}

#[test]
fn a_connection_is_there_until_it_ends() {
    let mut c = Central::<RobotPose>::new(CentralConfig::DEFAULT).unwrap();
    let state = |c: &Central<RobotPose>| (c.is_connected(), c.is_ended());
    assert_eq!(state(&c), (false, false));
    connect(&mut c);
    assert_eq!(state(&c), (true, false));
    send(&mut c, ZERO, Command::Stop);
    assert_eq!(state(&c), (true, false));
    receive(&mut c, ZERO, b"OK\r\n");
    send(&mut c, ZERO, Command::Stop);
    c.abort(ZERO);
    assert_eq!(state(&c), (false, true), "it is to be closed");
    c.handle_disconnected(ZERO);
    assert_eq!(state(&c), (false, false));
    let count = c.statistics();
    assert_eq!((count.connections, count.commands, count.lines, count.unknown), (1, 2, 1, 1));
}
