//! How a session begins, keeps its deadlines, misses one and ends: both ends, on a good line and on one that corrupts bytes.

use core::time::Duration;

use crate::val2_alter::common::{CYCLE, Cell, MS, connected, controller, in_first_cycle, plain, running, x};
use robot_session::Session as _;
use testkit::link::{End as Side, Faults};
use val2_alter::{
    ControllerConfig, ControllerEvent, ControllerState, End, ErrorCode, Frame, Host, HostConfig, HostEvent,
    HostState, Limits, Mode, Motion, Policy, SegmentStatus, SessionError, Start, timing,
};

#[test]
fn a_start_message_then_one_standard_message_every_28_ms() {
    let (host, controller) = plain();
    let mut cell = Cell::new(host, controller);
    cell.start();
    cell.cycles(10);
    assert_eq!(cell.host_events[0], HostEvent::Start(Start::new(Mode(23), Default::default())));
    assert_eq!(cell.controller_events[0], ControllerEvent::Started);
    let times: Vec<_> = cell.sent.iter().map(|(at, _)| at.as_millis()).collect();
    assert_eq!(times, [0, 28, 56, 84, 112, 140, 168, 196, 224, 252, 280]);
    assert_eq!((cell.host.statistics().cycles, cell.host.statistics().replies), (9, 9));
    assert_eq!(cell.host.statistics().missed, 0);
    assert_eq!(cell.controller.statistics().replies, 9);
}

#[test]
fn without_an_answer_the_controller_tries_three_times() {
    for attempts in [3, 4] {
        let (host, controller) = plain();
        let host = HostConfig { policy: Policy::Ignore, ..host };
        let mut cell = Cell::new(host, ControllerConfig { attempts, ..controller });
        cell.start();
        cell.cycles(20);
        let times: Vec<_> = cell.sent.iter().map(|(at, _)| at.as_millis()).collect();
        assert_eq!(times, [0, 28, 56, 84][..usize::from(attempts)]);
        let mut events = vec![ControllerEvent::BadReply(ErrorCode::Timeout); attempts.into()];
        events.push(ControllerEvent::GaveUp);
        assert_eq!(cell.controller_events, events);
        assert_eq!(cell.controller.state(), ControllerState::Off);
        // Each attempt after the first gives the reason for which it was made.
        assert_eq!(cell.sent[1].1[3], 0xA6);
    }
}

#[test]
fn a_host_may_refuse() {
    let (host, controller) = plain();
    let mut cell = Cell::new(HostConfig { policy: Policy::Refuse, ..host }, controller);
    cell.start();
    cell.cycles(5);
    assert_eq!(cell.controller_events, [ControllerEvent::Refused]);
    assert_eq!((cell.sent.len(), cell.host.state()), (1, HostState::Idle));
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
    assert_eq!(answer(&mut host, MS, b"\x10\x10\x02\xA0\x17\x10\x03\xB7"), Some(accept));
    assert_eq!(host.state(), HostState::Running);
    assert_eq!(answer(&mut host, MS, b"\x10\x10\x02\xE0\x10\x03\xE0"), None);
    assert_eq!(answer(&mut host, MS, corrupt), Some(repeat));
}

#[test]
fn another_mode_is_refused() {
    let mut host = connected(HostConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    host.handle_input(MS, b"\x10\x10\x02\xA0\x16\x10\x03\xB6");
    assert_eq!(host.poll_event(), Some(HostEvent::Start(Start::new(Mode(22), Default::default()))));
    assert_eq!(host.poll_transmit(MS, &mut out), Some(7));
    assert_eq!((&out[..7], host.state()), (b"\x10\x10\x02\xFF\x10\x03\xFF".as_slice(), HostState::Idle));
}

#[test]
fn a_repeat_counts_as_an_attempt() {
    let mut controller = controller(ControllerConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    controller.start(Duration::ZERO).unwrap();
    for attempt in 0..3 {
        let now = CYCLE * attempt;
        assert_eq!(controller.poll_transmit(now, &mut out), Some(8), "attempt {attempt}");
        controller.handle_input(now + 5 * MS, b"\x10\x10\x02\x01\x10\x03\x01");
    }
    assert_eq!(controller.poll_event(), Some(ControllerEvent::GaveUp));
    assert_eq!(controller.poll_transmit(CYCLE * 3, &mut out), None);
    assert_eq!(controller.start(CYCLE * 4), Ok(()));
    assert_eq!(controller.start(CYCLE * 4), Err(SessionError::AlreadyStarted));
}

#[test]
fn a_bad_reply_gives_the_code_of_the_next_message_and_a_missing_one_ends_alter() {
    let too_long = [b"\x10\x10\x02".as_slice(), &[0; 15], b"\x10\x03\x00"].concat();
    let cases: [(&[u8], u8); 12] = [
        (b"\x10\x10\x02\x00\x00\x10\x03\x00", 0x80),
        (b"\x10\x10\x02\x00\x00\x10\x03\x01", 0x81),
        (b"\x10\x10\x02\x00\x01\x10\x03\x01", 0x82), // selects X, sends none
        (b"\x10\x10\x02\x00\x40\x10\x03\x40", 0x82), // selects a bit that is not an axis
        (b"\x10\x10\x02\x00\x10\x03\x00", 0x82),     // the answer to a start message
        (&too_long, 0x83),
        (b"\x10\x10\x02\x00\x00", 0x84),
        (b"\x10\x10\x02\x00\x10", 0x84),
        (b"\x10\x02\x00\x00\x10\x03\x00", 0x85), // one DLE in front
        (b"\x10\x10\x02\x00\x10\x04\x00", 0x85), // no end mark
        (b"", 0xE6),
        // Damage in front of a good reply costs nothing.
        (b"\x55\x10\x10\x02\x00\x00\x10\x03\x00", 0x80),
    ];
    for (reply, control) in cases {
        let mut controller = in_first_cycle(ControllerConfig::default());
        let mut out = [0; Frame::MAX_LEN];
        controller.handle_input(CYCLE + 12 * MS, reply);
        // A frame that breaks off is given up after a gap; then the window closes.
        while let Some(next) = controller.poll_timeout().filter(|next| *next < CYCLE * 2) {
            controller.handle_timeout(next);
        }
        assert_eq!(controller.poll_timeout(), Some(CYCLE * 2), "{reply:02X?}");
        assert_eq!(controller.poll_transmit(CYCLE * 2 - MS, &mut out), None);
        let len = controller.poll_transmit(CYCLE * 2, &mut out).unwrap();
        assert_eq!(out[3], control, "{reply:02X?} gives {:02X?}", &out[..len]);
        let state = if control == 0xE6 { ControllerState::Off } else { ControllerState::Running };
        assert_eq!(controller.state(), state);
    }
}

#[test]
fn the_window_is_15_ms_cumulative_and_17_ms_non_cumulative() {
    for (mode, window) in [(19, 15 * MS), (18, 17 * MS)] {
        let controller = in_first_cycle(ControllerConfig { mode: Mode(mode), ..Default::default() });
        // The message has 12 bytes.
        assert_eq!(controller.poll_timeout(), Some(CYCLE + timing::transmission_time(12, 38_400) + window));
        let mut late = controller.clone();
        late.handle_input(late.poll_timeout().unwrap(), b"\x10\x10\x02\x00\x00\x10\x03\x00");
        assert_eq!(late.state(), ControllerState::Ending);
        let mut in_time = controller.clone();
        in_time
            .handle_input(in_time.poll_timeout().unwrap() - MS / 1000, b"\x10\x10\x02\x00\x00\x10\x03\x00");
        assert_eq!(in_time.state(), ControllerState::Running);
    }
}

#[test]
fn what_comes_while_the_message_is_on_the_line_is_no_reply_to_it() {
    let reply = b"\x10\x10\x02\x00\x01\x50\x00\x10\x03\x51";
    // 36 bytes take 18.75 ms.
    let controller = in_first_cycle(ControllerConfig { baud: 19_200, ..Default::default() });
    let opens = CYCLE + timing::transmission_time(36, 19_200);
    let mut early = controller.clone();
    early.handle_input(opens - MS / 1000, reply);
    assert!(matches!(early.poll_event(), Some(ControllerEvent::Stray(_))));
    assert_eq!((early.values(), early.statistics().strays, early.statistics().replies), ([0; 6], 1, 0));
    // The window is open for bytes that come then, and earlier corrupt bytes have no effect.
    early.handle_input(opens - MS / 1000, b"\x10\x10\x02\x00\x00\x10\x03\x01");
    early.handle_input(opens, reply);
    assert_eq!((early.values(), early.statistics().replies), (x(80), 1));
    early.poll_transmit(CYCLE * 2, &mut [0; Frame::MAX_LEN]).unwrap();
    assert_eq!(early.statistics().bad_replies, 0);
    // Nor does it keep an ALTER on whose reply is missing.
    let mut missing = controller;
    missing.handle_input(opens - MS / 1000, b"\x10\x10\x02\x00\x00\x10\x03\x01");
    missing.handle_timeout(missing.poll_timeout().unwrap());
    missing.handle_timeout(missing.poll_timeout().unwrap());
    assert_eq!(missing.poll_event(), Some(ControllerEvent::BadReply(ErrorCode::Timeout)));
    assert_eq!(missing.state(), ControllerState::Ending);
}

#[test]
fn a_killed_host_ends_alter_with_error_6_and_the_arm_stands_still() {
    let (host, controller) = plain();
    let mut cell = running(host, controller);
    cell.host.set_target(cell.now, x(80));
    cell.cycles(5);
    cell.host_is_alive = false;
    // The reply that is on its way still counts; from then on nothing moves.
    cell.cycles(1);
    let offset = cell.offset();
    cell.cycles(50);
    assert_eq!(cell.offset(), offset);
    assert_eq!(cell.controller.state(), ControllerState::Off);
    assert_eq!(cell.controller_events.last(), Some(&ControllerEvent::Ended(ErrorCode::Timeout)));
    assert_eq!(cell.sent.last().unwrap().1, b"\x10\x10\x02\xE6\x10\x03\xE6");

    // Only the host is restarted: a new one has no record of the old one.
    cell.host = connected(host);
    cell.host_is_alive = true;
    cell.start();
    cell.cycles(3);
    assert_eq!(cell.offset(), offset, "the target is zero after a start");
    cell.host.set_target(cell.now, x(80));
    cell.cycles(3);
    assert_eq!(cell.offset()[0] - offset[0], 240);
}

#[test]
fn a_missed_cycle_is_counted_and_the_next_start_is_taken() {
    let (host, controller) = plain();
    let mut cell = running(host, controller);
    // The host is away for two cycles, then continues with the bytes that have arrived meanwhile.
    cell.host_is_alive = false;
    let asleep = cell.now;
    while cell.now < asleep + CYCLE * 3 / 2 {
        // The host does not read: arriving bytes wait in the operating system.
        let mut out = [0; Frame::MAX_LEN];
        cell.now += MS;
        cell.controller.handle_timeout(cell.now);
        while let Some(len) = cell.controller.poll_transmit(cell.now, &mut out) {
            cell.link.send(Side::A, cell.now, &out[..len]);
        }
    }
    cell.host_is_alive = true;
    let stats = cell.host.statistics();
    cell.cycles(2);
    assert_eq!(cell.controller.state(), ControllerState::Off);
    assert!(cell.host_events.contains(&HostEvent::End(End { error: ErrorCode::Timeout })));
    assert_eq!((cell.host.state(), cell.host.statistics().ends), (HostState::Idle, stats.ends + 1));
    cell.start();
    cell.cycles(5);
    assert_eq!(cell.host.state(), HostState::Running);
    assert_eq!((cell.host.statistics().starts, cell.controller.statistics().starts), (2, 2));
}

#[test]
fn the_deadline_is_the_window_less_the_reply() {
    let mut host = connected(HostConfig { limits: Limits::NONE, mode: Mode(19), ..HostConfig::default() });
    let mut out = [0; Frame::MAX_LEN];
    let motion = b"\x10\x10\x02\x80\x02\x01\x00\x00\x20\x10\x03\xA3";
    let start = |host: &mut Host, now| {
        host.handle_input(now, b"\x10\x10\x02\xA0\x13\x10\x03\xB3");
        host.poll_transmit(now, &mut [0; Frame::MAX_LEN]).unwrap();
        while host.poll_event().is_some() {}
    };
    start(&mut host, MS);
    let arrived = 28 * MS;
    host.handle_input(arrived, motion);
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
    host.handle_input(56 * MS, &[motion.as_slice(), motion].concat());
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
    host.handle_input(MS, b"\x10\x10\x02\xA0\x17\x10\x03\xB7");
    assert!(host.poll_transmit(MS, &mut out).is_some());
    // By 10 ms, which is in time, and by 11 ms.
    for at in [2, 30, 58 + 10, 86, 114 + 11, 142, 170] {
        host.handle_input(MS * at, b"\x10\x10\x02\x80\x02\x01\x00\x00\x20\x10\x03\xA3");
        assert!(host.poll_transmit(MS * at, &mut out).is_some());
        let events = core::iter::from_fn(|| host.poll_event());
        reported.extend(events.filter(|event| *event == HostEvent::Delayed).map(|_| at));
    }
    assert_eq!((reported, host.statistics().delayed), (vec![142], 1));
}

#[test]
fn the_program_may_end_alter() {
    let (host, controller) = plain();
    let mut cell = running(host, controller);
    cell.controller.set_segment(SegmentStatus::Finished, 7, Motion::DONE);
    cell.cycles(2);
    let motion = cell.last_motion();
    assert_eq!((motion.segment_status, motion.segment, motion.fraction()), (SegmentStatus::Finished, 7, 1.0));
    cell.controller.finish(cell.now).unwrap();
    cell.cycles(2);
    assert_eq!(cell.sent.last().unwrap().1, b"\x10\x10\x02\xE0\x10\x03\xE0");
    assert_eq!(cell.host_events.last(), Some(&HostEvent::End(End { error: ErrorCode::None })));
}

#[test]
fn a_late_controller_keeps_its_raster_and_every_window() {
    let reply = b"\x10\x10\x02\x00\x00\x10\x03\x00";
    let mut out = [0; Frame::MAX_LEN];
    let mut sent = Vec::new();
    let mut controller = in_first_cycle(ControllerConfig { mode: Mode(19), ..Default::default() });
    // It is late by 3 ms, then by 20 ms.
    for late in [3, 0, 20, 0, 0] {
        controller.handle_input(controller.poll_timeout().unwrap() - MS, reply);
        let now = controller.poll_timeout().unwrap() + MS * late;
        controller.poll_transmit(now, &mut out).unwrap();
        sent.push(now.as_micros() / 1000);
    }
    // 132 ms and a window of 15 ms after 12 bytes are 150 ms: later than the raster, which continues from there.
    assert_eq!(sent, [59, 84, 132, 150, 178]);
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

#[test]
fn an_event_queue_that_nobody_reads_drops_the_oldest_notice_and_no_outcome() {
    let mut host = connected(HostConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    let start = b"\x10\x10\x02\xA0\x17\x10\x03\xB7";
    let end = b"\x10\x10\x02\xE0\x10\x03\xE0";
    host.handle_input(MS, start);
    assert_eq!(host.poll_transmit(MS, &mut out), Some(7));
    for _ in 0..20 {
        host.handle_input(MS, end);
    }
    assert_eq!(host.statistics().dropped_notices, 5);
    let left = core::iter::from_fn(|| host.poll_event()).collect::<Vec<_>>();
    assert_eq!(left, [HostEvent::End(End { error: ErrorCode::None }); 16]);
    // Fifteen ends of ALTER that are not polled: the queue has no space for the outcomes of another.
    for accepted in (0..17).map(|ends| ends < 15) {
        host.handle_input(MS, start);
        assert_eq!(host.poll_transmit(MS, &mut out).is_some(), accepted);
        host.handle_input(MS, end);
    }
    let ends = core::iter::from_fn(|| host.poll_event()).filter(|event| matches!(event, HostEvent::End(_)));
    assert!(ends.count() >= 15);
}

#[test]
fn a_gap_ends_a_frame() {
    let frame = b"\x10\x10\x02\xA0\x17\x10\x03\xB7";
    for (gap, received) in [(Some(4 * MS), false), (None, true), (Some(40 * MS), true)] {
        let mut host = connected(HostConfig { gap, ..HostConfig::default() });
        host.handle_input(MS, &frame[..5]);
        host.handle_input(6 * MS, &frame[5..]);
        assert_eq!(host.state() == HostState::Starting, received, "{gap:?}");
    }
}

/// A line that flips, loses and inserts bytes, and falls silent: the cell takes ALTER up again each time, and nothing that
/// moves the arm breaks a limit.
#[test]
fn a_bad_line_is_survived() {
    let limits = Limits { velocity: [60; 6], acceleration: [7; 6] };
    let faults = Faults { latency: Duration::ZERO, max_delay: 3 * MS, ..Faults::SERIAL };
    let (mut cycles, mut starts, mut corrupt) = (0, 0, 0);
    for seed in 0..20 {
        let (host, controller) = plain();
        let mut cell = Cell::with_faults(HostConfig { limits, ..host }, controller, seed, faults);
        for round in 0..200 {
            if cell.controller.state() == ControllerState::Off {
                cell.start();
            }
            cell.host.set_target(cell.now, [[100; 6], [0; 6], [-100; 6]][round % 3]);
            cell.cycles(5);
        }
        assert!(cell.applied.iter().flatten().all(|value| value.abs() <= 60), "seed {seed}");
        cycles += cell.host.statistics().replies;
        starts += cell.host.statistics().starts;
        corrupt += cell.link.counts().corruption();
        assert_eq!(cell.host.statistics().dropped_notices, 0);
    }
    println!("{cycles} replies, {starts} starts, {corrupt} faults");
    assert!(cycles > 10_000 && starts > 500 && corrupt > 2_000, "{cycles} {starts} {corrupt}");
}
