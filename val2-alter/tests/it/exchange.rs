//! The messages of an exchange: their times, repetitions and counts.

use core::time::Duration;

use robot_session::Session as _;
use val2_alter::{
    Controller, ControllerConfig, ControllerEvent, ControllerState, Exception, ExceptionOutcome, Frame,
    Framing, Host, HostConfig, HostEvent, HostMessage, HostState, Limits, Message as _, Mode, SessionError,
    StartCode, timing,
};

const MS: Duration = Duration::from_millis(1);
const CYCLE: Duration = timing::CYCLE;
const START: &[u8] = b"\x10\x10\x02\xA0\x17\x10\x03\xB7";
const GOOD: &[u8] = b"\x10\x10\x02\x80\x02\x01\x00\x00\x20\x10\x03\xA3";
const REJECTED: &[u8] = b"\x10\x10\x02\x81\x02\x01\x00\x00\x20\x10\x03\xA4";
const TIMEOUT: &[u8] = b"\x10\x10\x02\x86\x02\x01\x00\x00\x20\x10\x03\xA9";

/// Returns a host on an open port.
fn connected(config: HostConfig) -> Host {
    let mut host = Host::new(config).unwrap();
    host.handle_connected(Duration::ZERO);
    host
}

/// Returns a controller on an open port.
fn controller(config: ControllerConfig) -> Controller {
    let mut controller = Controller::new(config).unwrap();
    controller.handle_connected(Duration::ZERO);
    controller
}

fn x(value: i16) -> [i16; 6] {
    [value, 0, 0, 0, 0, 0]
}

/// Returns a controller in its first cycle, at 28 ms, whose message has just left.
fn in_first_cycle(config: ControllerConfig) -> Controller {
    let mut controller = self::controller(config);
    let mut out = [0; Frame::MAX_LEN];
    controller.start(Duration::ZERO).unwrap();
    controller.poll_transmit(Duration::ZERO, &mut out).unwrap();
    controller.handle_input(5 * MS, b"\x10\x10\x02\x00\x10\x03\x00");
    assert_eq!(controller.poll_event(), Some(ControllerEvent::Started));
    controller.poll_transmit(CYCLE, &mut out).unwrap();
    controller
}

#[test]
fn a_corrupt_start_message_is_asked_for_again_and_then_refused() {
    let mut host = connected(HostConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    let corrupt = b"\x10\x10\x02\xA0\x17\x10\x03\xB8";
    let mut answer = |host: &mut Host, now, bytes: &[u8]| {
        host.handle_input(now, bytes);
        host.poll_transmit(now, &mut out).map(|len| out[3..len].to_vec())
    };
    let (accept, repeat, refuse) = (vec![0, 0x10, 3, 0], vec![1, 0x10, 3, 1], vec![0xFF, 0x10, 3, 0xFF]);
    for expected in [&repeat, &repeat, &refuse, &repeat] {
        assert_eq!(answer(&mut host, MS, corrupt).as_ref(), Some(expected));
    }
    // The count restarts after four cycles without a message.
    assert_eq!(answer(&mut host, MS + 4 * CYCLE, corrupt).as_ref(), Some(&repeat));
    assert_eq!(answer(&mut host, MS + 4 * CYCLE, corrupt).as_ref(), Some(&repeat));
    // Bytes outside any frame are not a start message.
    let mut other = connected(HostConfig::default());
    assert_eq!(answer(&mut other, MS, b"noise\x10\x10\x02"), None);
    assert_eq!(other.statistics().corrupt, 1);
    // A good one starts again.
    assert_eq!(answer(&mut host, MS, START), Some(accept));
    assert_eq!(host.state(), HostState::Running);
    assert_eq!(answer(&mut host, MS, b"\x10\x10\x02\xE0\x10\x03\xE0"), None);
    assert_eq!(answer(&mut host, MS, corrupt), Some(repeat));
}

#[test]
fn the_deadline_is_the_window_less_the_reply() {
    let mut host = connected(HostConfig { limits: Limits::NONE, mode: Mode(19), ..HostConfig::default() });
    let mut out = [0; Frame::MAX_LEN];
    let start = |host: &mut Host, now| {
        host.handle_input(now, b"\x10\x10\x02\xA0\x13\x10\x03\xB3");
        host.poll_transmit(now, &mut [0; Frame::MAX_LEN]).unwrap();
        while host.poll_event().is_some() {}
    };
    start(&mut host, MS);
    let arrived = 28 * MS;
    host.handle_input(arrived, GOOD);
    let deadline = arrived + 15 * MS - timing::transmission_time(8, 38_400);
    assert_eq!((host.reply_by(), host.poll_timeout()), (Some(deadline), Some(deadline)));
    host.poll_event();
    // Six words if they fit, otherwise only those that are not zero.
    let six = arrived + 14 * MS - timing::transmission_time(20, 38_400);
    assert_eq!(host.clone().poll_transmit(six, &mut out), Some(20));
    assert_eq!(host.clone().poll_transmit(deadline, &mut out), Some(8));

    // Words that are not zero wait at rest if they do not fit; a late reply is not sent.
    host.set_target(arrived, [0x1010; 6]);
    assert_eq!(host.clone().poll_transmit(deadline, &mut out), Some(8));
    assert_eq!(host.clone().poll_transmit(six, &mut out), Some(8 + 4 * 3));
    let mut late = host.clone();
    assert_eq!(late.poll_transmit(deadline + MS, &mut out), None);
    assert_eq!((late.poll_event(), late.poll_timeout()), (None, Some(deadline + MS)));
    late.handle_timeout(deadline + MS);
    assert_eq!((late.poll_event(), late.statistics().missed), (Some(HostEvent::Missed), 1));
    assert_eq!(late.poll_transmit(deadline, &mut out), None);

    host.handle_timeout(deadline);
    assert_eq!((host.poll_event(), host.statistics().missed), (Some(HostEvent::Missed), 1));
    assert_eq!(host.poll_transmit(deadline, &mut out), None);
    assert_eq!(host.poll_timeout(), Some(arrived + CYCLE * 4));

    // The next one is answered again, and two at once are one missed and one answered.
    host.handle_input(56 * MS, &[GOOD, GOOD].concat());
    assert!(host.poll_transmit(56 * MS, &mut out).is_some());
    assert_eq!((host.statistics().cycles, host.statistics().replies, host.statistics().missed), (3, 1, 2));

    host.handle_timeout(56 * MS + CYCLE * 4);
    assert_eq!((host.state(), host.statistics().lost), (HostState::Idle, 1));
    assert_eq!(host.poll_timeout(), None);
}

/// A controller sends one message in a cycle: a message sooner after the previous one shows that this was late.
#[test]
fn a_message_that_was_read_too_late_is_reported_with_the_next() {
    let mut host = connected(HostConfig::default());
    let (mut out, mut reported) = ([0; Frame::MAX_LEN], Vec::new());
    host.handle_input(MS, START);
    assert!(host.poll_transmit(MS, &mut out).is_some());
    // By 10 ms, which is in time, and by 11 ms.
    for at in [2, 30, 58 + 10, 86, 114 + 11, 142, 170] {
        host.handle_input(MS * at, GOOD);
        assert!(host.poll_transmit(MS * at, &mut out).is_some());
        let events = core::iter::from_fn(|| host.poll_event());
        reported.extend(events.filter(|event| *event == HostEvent::Delayed).map(|_| at));
    }
    assert_eq!((reported, host.statistics().delayed), (vec![142], 1));
}

#[test]
fn the_controller_takes_the_first_good_reply_and_reports_the_first_damage() {
    let mut out = [0; Frame::MAX_LEN];
    let good = |value: u8| [0x10, 0x10, 0x02, 0, 1, value, 0, 0x10, 0x03, 1 + value];
    let bad_sum = b"\x10\x10\x02\x00\x00\x10\x03\x01";
    let bad_format = b"\x10\x10\x02\x00\x40\x10\x03\x40";

    let mut controller = in_first_cycle(ControllerConfig::default());
    controller.handle_input(CYCLE + 12 * MS, &[good(32), good(64)].concat());
    assert_eq!((controller.values(), controller.statistics().replies), (x(32), 1));
    controller.poll_transmit(CYCLE * 2, &mut out).unwrap();
    controller.handle_input(CYCLE * 2 + 12 * MS, &[bad_sum.as_slice(), bad_format].concat());
    controller.poll_transmit(CYCLE * 3, &mut out).unwrap();
    assert_eq!((out[3], controller.values()), (0x81, [0; 6]));
    controller.handle_input(CYCLE * 3 + 12 * MS, &good(64));
    controller.poll_transmit(CYCLE * 4, &mut out).unwrap();
    assert_eq!((out[3], controller.values()), (0x80, x(64)));

    // A gap breaks a reply off; the next one in the same window counts.
    controller.handle_input(CYCLE * 4 + 11 * MS, b"\x10\x10\x02\x00\x01");
    let whole = controller.clone();
    for (gap, value) in [(5, 32), (1, 96)] {
        let mut controller = whole.clone();
        let rest = b"\x60\x00\x10\x03\x61\x10\x10\x02\x00\x01\x20\x00\x10\x03\x21";
        controller.handle_input(CYCLE * 4 + (11 + gap) * MS, rest);
        assert_eq!(controller.values(), x(value), "{gap} ms");
    }

    // The program ends ALTER in the window: a later reply does not move the arm.
    let mut controller = whole.clone();
    controller.finish(CYCLE * 4).unwrap();
    controller.handle_input(CYCLE * 4 + 12 * MS, &good(96));
    assert_eq!(controller.values(), [0; 6]);
    assert_eq!(controller.state(), ControllerState::Ending);
}

#[test]
fn the_first_standard_message_knows_nothing_of_the_attempts() {
    let mut controller = controller(ControllerConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    controller.start(Duration::ZERO).unwrap();
    controller.poll_transmit(Duration::ZERO, &mut out).unwrap();
    controller.poll_transmit(CYCLE, &mut out).unwrap();
    assert_eq!(out[3], 0xA6);
    controller.handle_input(CYCLE + 3 * MS, b"\x10\x10\x02\x00\x10\x03\x00");
    controller.poll_transmit(CYCLE * 2, &mut out).unwrap();
    assert_eq!(out[3], 0x80);
}

/// Returns the host's answer.
fn answer(host: &mut Host, message: &[u8]) -> HostMessage {
    let mut out = [0; Frame::MAX_LEN];
    host.handle_input(MS, message);
    let len = host.poll_transmit(MS, &mut out).unwrap();
    let (frame, _) = Frame::decode(&out[..len], Framing::DEFAULT).unwrap().unwrap();
    HostMessage::decode(frame.data(), Framing::DEFAULT).unwrap()
}

/// Returns a host in an ALTER with an exception to be sent.
fn with_exception() -> Host {
    let mut host = connected(HostConfig { subroutine: true, limits: Limits::NONE, ..HostConfig::default() });
    let accepted = answer(&mut host, START);
    assert_eq!(accepted, HostMessage::StartReply(StartCode::Accept));
    assert_eq!(host.exception(MS, Exception::OpenGripper), Err(SessionError::NotRunning));
    answer(&mut host, GOOD);
    host.exception(MS, Exception::OpenGripper).unwrap();
    host
}

/// Returns the codes in the answers to these messages.
fn codes<const N: usize>(host: &mut Host, messages: [&[u8]; N]) -> [u8; N] {
    messages.map(|message| match answer(host, message) {
        HostMessage::Reply(reply) => reply.exception.into(),
        HostMessage::StartReply(code) => panic!("{code:?}"),
    })
}

fn outcomes(host: &mut Host) -> Vec<ExceptionOutcome> {
    let outcome = |event| match event {
        HostEvent::Exception { exception: Exception::OpenGripper, outcome } => Some(outcome),
        _ => None,
    };
    core::iter::from_fn(|| host.poll_event()).filter_map(outcome).collect()
}

#[test]
fn an_exception_that_was_not_read_is_sent_again() {
    for unread in [REJECTED, TIMEOUT] {
        let mut host = with_exception();
        let messages = [GOOD, unread, unread, REJECTED, GOOD, GOOD, REJECTED];
        assert_eq!(codes(&mut host, messages), [254, 0, 254, 0, 254, 0, 0]);
        assert_eq!(host.statistics().rejected, 4);
        assert_eq!(outcomes(&mut host), [ExceptionOutcome::Done]);
    }
}

/// The controller has ended ALTER, is silent, or begins again.
#[test]
fn the_last_reply_has_an_outcome_too() {
    for is_ended in [true, false] {
        let mut host = with_exception();
        assert_eq!(codes(&mut host, [GOOD]), [254]);
        if is_ended {
            host.handle_input(MS, b"\x10\x10\x02\xE6\x10\x03\xE6");
        } else {
            host.handle_timeout(MS + 4 * CYCLE);
        }
        assert_eq!(outcomes(&mut host).len(), 1, "{is_ended}");
    }
    let mut host = with_exception();
    host.handle_input(MS, GOOD);
    host.handle_input(MS, START);
    assert_eq!((host.statistics().missed, host.statistics().lost), (1, 1), "ALTER begins again");
}
