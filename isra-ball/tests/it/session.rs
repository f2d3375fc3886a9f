//! Each end by itself, and every rule of the source.

use core::time::Duration;

use isra_ball::robot_session::{Decoder as _, Encode as _, Session};
use isra_ball::{
    Ball, BallConfig, BallEvent, ConfigError, DecodeError, Decoder, EncodeError, Host, HostConfig, HostEvent,
    Keys, Packet, Status, timing,
};

const MS: Duration = Duration::from_millis(1);

fn packet(status: Status, x: i8) -> Packet {
    Packet { sensor_type: 0, sensor: 0, status, force: [x, 0, 0], moment: [0; 3], keys: Keys::NONE }
}

fn fresh(x: i8) -> Packet {
    packet(Status::Fresh, x)
}

fn bytes(packet: Packet) -> [u8; 12] {
    packet.to_bytes().unwrap()
}

fn events<S: Session>(session: &mut S) -> Vec<S::Event> {
    core::iter::from_fn(|| session.poll_event()).collect()
}

/// Returns a host that has just been connected.
fn host() -> Host {
    let mut host = Host::new(HostConfig::default()).unwrap();
    host.handle_connected(Duration::ZERO);
    host
}

/// Sends the next poll when it is due; the time.
fn poll(host: &mut Host) -> Duration {
    for _ in 0..4 {
        let now = host.poll_timeout().unwrap();
        let mut out = [0; 1];
        if host.poll_transmit(now, &mut out).is_some() {
            assert_eq!(out, [0x05]);
            return now;
        }
    }
    panic!("no poll: {host:?}");
}

/// Runs one exchange; returns the time at which the poll was sent.
fn exchange(host: &mut Host, reply: Packet) -> Duration {
    let now = poll(host);
    host.handle_input(now + 14 * MS, &bytes(reply));
    now
}

/// §9.5: "Die Sendung eines ENQ-Zeichen erfolgt jetzt zeitgesteuert."
#[test]
fn the_host_polls_each_period_and_the_first_poll_waits_for_the_reply_to_another_host() {
    let mut host = host();
    let first = poll(&mut host);
    assert_eq!(
        first.as_micros(),
        44_708,
        "a period, the 14 ms that a reply may be late, and a fifth of 13.541"
    );
    host.handle_input(first + 14 * MS, &bytes(fresh(1)));
    let second = exchange(&mut host, fresh(2));
    assert_eq!(second, first + 28 * MS);
    assert_eq!(poll(&mut host), second + 28 * MS);
}

#[test]
fn values_are_new_only_if_the_reply_before_proves_it() {
    let mut host = host();
    // The ball may have measured this long ago, before the first poll.
    let first = exchange(&mut host, fresh(1));
    assert_eq!((events(&mut host), host.live_until()), (vec![HostEvent::Old(fresh(1))], None));
    // This was measured after the first reply, so after the first poll.
    exchange(&mut host, fresh(2));
    assert_eq!(events(&mut host), [HostEvent::Packet(fresh(2))]);
    assert_eq!(host.live_until(), Some(first + 150 * MS));
    // The ball cannot measure any more.
    for _ in 0..3 {
        exchange(&mut host, packet(Status::Old, 2));
        assert_eq!(events(&mut host), [HostEvent::Old(packet(Status::Old, 2))]);
    }
    assert_eq!(host.live_until(), Some(first + 150 * MS));
    host.handle_timeout(first + 150 * MS - MS / 10);
    assert_eq!(events(&mut host), []);
    host.handle_timeout(first + 150 * MS);
    assert_eq!((events(&mut host), host.live_until()), (vec![HostEvent::Stale], None));
    for _ in 0..100 {
        exchange(&mut host, packet(Status::Old, 2));
        events(&mut host);
    }
    assert_eq!((host.statistics().stale, host.statistics().packets, host.statistics().old), (1, 1, 104));
}

#[test]
fn the_outcomes_that_nobody_takes_hold_the_next_poll_back() {
    let mut host = host();
    for _ in 0..6 {
        exchange(&mut host, fresh(1));
    }
    let now = host.poll_timeout().unwrap();
    assert_eq!(host.poll_transmit(now, &mut [0]), None, "a poll may end in three outcomes, two have room");
    assert_eq!(host.poll_event(), Some(HostEvent::Old(fresh(1))));
    assert_eq!(host.poll_transmit(now, &mut [0]), Some(1));
    host.handle_timeout(now + 1000 * MS);
    let mut expected = vec![HostEvent::Packet(fresh(1)); 5];
    expected.extend([HostEvent::Missed, HostEvent::Stale]);
    assert_eq!(events(&mut host), expected);
    assert_eq!(host.statistics().dropped_notices, 0);
}

#[test]
fn a_silent_ball_is_missed_each_period_and_stale_once() {
    let mut host = host();
    exchange(&mut host, fresh(1));
    let last = exchange(&mut host, fresh(2));
    events(&mut host);
    let (mut polls, mut missed, mut stale) = (Vec::new(), Vec::new(), Vec::new());
    for t in 0..400 {
        let now = last + t * MS;
        host.handle_timeout(now);
        if host.poll_transmit(now, &mut [0]).is_some() {
            polls.push(t);
        }
        for event in events(&mut host) {
            match event {
                HostEvent::Missed => missed.push(t),
                HostEvent::Stale => stale.push(t),
                other => panic!("{other:?}"),
            }
        }
    }
    // After a poll without a reply the next one is later.
    assert_eq!(polls[..5], [28, 73, 118, 163, 208]);
    assert_eq!(missed[..4], [56, 101, 146, 191]);
    // 150 ms after the poll whose reply the last values are newer than.
    assert_eq!(stale, [122]);
}

#[test]
fn a_pause_of_the_host_is_not_made_up_for_by_a_burst() {
    let mut host = host();
    let mut polls = Vec::new();
    for t in (0..100).chain(500..600) {
        if host.poll_transmit(MS * t, &mut [0]).is_some() {
            polls.push(t);
        }
        events(&mut host);
    }
    assert_eq!(polls, [45, 90, 517, 562]);
}

#[test]
fn a_packet_that_can_be_no_reply_is_unasked() {
    let mut host = host();
    let unasked = |x| HostEvent::Unasked(fresh(x));
    host.handle_input(10 * MS, &bytes(fresh(1)));
    assert_eq!(events(&mut host), [unasked(1)], "no poll");
    let now = poll(&mut host);
    host.handle_input(now + 12 * MS, &bytes(fresh(2)));
    assert_eq!(events(&mut host), [unasked(2)], "faster than the line");
    host.handle_input(now + 13 * MS, &[bytes(fresh(3)), bytes(fresh(4))].concat());
    assert_eq!(events(&mut host), [HostEvent::Old(fresh(3)), unasked(4)]);
    let now = poll(&mut host);
    host.handle_input(now + 27 * MS, &bytes(fresh(5)));
    assert_eq!(events(&mut host), [HostEvent::Packet(fresh(5))]);
    let now = poll(&mut host);
    // The host was not called for a second: how long the packet has waited nobody knows.
    host.handle_input(now + 1000 * MS, &bytes(fresh(6)));
    assert_eq!(events(&mut host), [HostEvent::Missed, HostEvent::Stale, unasked(6)]);
    assert_eq!((host.statistics().unasked, host.statistics().missed, host.statistics().polls), (4, 1, 3));
}

#[test]
fn the_first_new_values_after_a_pause_are_not_used() {
    let mut host = host();
    exchange(&mut host, fresh(1));
    let last = exchange(&mut host, fresh(2));
    events(&mut host);
    // No poll comes for a second; the ball then sends the values that it measured at its beginning.
    let now = last + 1000 * MS;
    host.poll_transmit(now, &mut [0]).unwrap();
    host.handle_input(now + 14 * MS, &bytes(fresh(3)));
    assert_eq!(events(&mut host), [HostEvent::Stale, HostEvent::Old(fresh(3))]);
    exchange(&mut host, fresh(4));
    assert_eq!(events(&mut host), [HostEvent::Packet(fresh(4))]);
}

#[test]
fn a_connection_ends_its_poll_and_its_values() {
    let mut host = host();
    exchange(&mut host, fresh(1));
    exchange(&mut host, fresh(2));
    let now = poll(&mut host);
    events(&mut host);
    host.handle_input(now + 10 * MS, &bytes(fresh(3))[..9]);
    host.handle_disconnected(now + 11 * MS);
    assert_eq!(events(&mut host), [HostEvent::Missed, HostEvent::Stale]);
    assert_eq!((host.poll_timeout(), host.poll_transmit(now + 90 * MS, &mut [0])), (None, None));
    host.handle_disconnected(now + 12 * MS);
    let again = now + 20 * MS;
    host.handle_connected(again);
    host.handle_connected(again);
    assert_eq!(host.poll_timeout(), Some(again + HostConfig::default().quiet()));
    // The rest of the packet is noise now, and another ball's first packet is of unknown age.
    host.handle_input(again + MS, &bytes(fresh(3))[9..]);
    exchange(&mut host, fresh(4));
    let seen = events(&mut host);
    assert_eq!(seen, [HostEvent::Corrupt(DecodeError::Noise { length: 3 }), HostEvent::Old(fresh(4))]);
}

#[test]
fn bytes_without_a_connection_are_unexpected() {
    let mut host = Host::new(HostConfig::default()).unwrap();
    assert_eq!((host.poll_timeout(), host.poll_transmit(MS, &mut [0])), (None, None));
    host.handle_input(MS, &bytes(fresh(1)));
    let seen = events(&mut host);
    assert!(
        matches!(seen[..], [HostEvent::Unexpected(e)] if e.to_string() == "Packet(fresh) is not expected in the state Disconnected"),
        "{seen:?}"
    );
    let mut ball = Ball::new(BallConfig::default()).unwrap();
    ball.handle_input(MS, &[0x05]);
    assert!(matches!(events(&mut ball)[..], [BallEvent::Unexpected(_)]));
    assert_eq!((ball.poll_transmit(MS, &mut [0; 12]), ball.statistics().unexpected), (None, 1));
    assert_eq!(host.statistics().unexpected, 1);
}

#[test]
fn a_cut_reply_is_given_up_when_no_reply_can_come() {
    let mut host = host();
    let now = poll(&mut host);
    host.handle_input(now + 10 * MS, &bytes(fresh(1))[..9]);
    assert_eq!(events(&mut host), []);
    exchange(&mut host, fresh(2));
    let cut = HostEvent::Corrupt(DecodeError::Incomplete { expected: 12, found: 9 });
    assert_eq!(events(&mut host), [cut, HostEvent::Missed, HostEvent::Old(fresh(2))]);
    assert_eq!(host.statistics().corrupt, 1);
}

/// §4.1: "integriertem XON/XOFF Software-Handshake", and the packets are unescaped binary.
#[test]
fn a_line_with_xon_xoff_loses_forces_of_17_and_19_and_a_raw_one_does_not() {
    let trap = Packet { force: [17, 19, -128], moment: [127, 0, 0], keys: Keys(0x10), ..fresh(0) };
    let plain = fresh(5);
    let reply = |xon_xoff: bool| {
        let mut host = host();
        for packet in [trap, plain, trap, plain] {
            let now = poll(&mut host);
            let mut bytes = bytes(packet).to_vec();
            bytes.retain(|byte| !xon_xoff || ![0x11, 0x13].contains(byte));
            host.handle_input(now + 14 * MS, &bytes);
        }
        host.handle_timeout(host.poll_timeout().unwrap());
        events(&mut host)
    };
    let [old, new] = [HostEvent::Old(trap), HostEvent::Packet(plain)];
    assert_eq!(reply(false), [old, new, HostEvent::Packet(trap), new]);
    let short = HostEvent::Corrupt(DecodeError::Incomplete { expected: 12, found: 10 });
    let missed = HostEvent::Missed;
    assert_eq!(reply(true), [short, missed, HostEvent::Old(plain), short, missed, new]);
}

/// §4.2: "Daten in Ordnung" and "alte Daten": the ball's processor has no new values yet and sends the ones before.
#[test]
fn values_asked_for_twice_are_old_the_second_time() {
    let mut ball = Ball::new(BallConfig { sensor_type: 2, sensor: 1, ..BallConfig::default() }).unwrap();
    ball.handle_connected(Duration::ZERO);
    let reply = |ball: &mut Ball| {
        let mut out = [0; 64];
        ball.handle_input(Duration::ZERO, &[0x05]);
        let n = ball.poll_transmit(Duration::ZERO, &mut out).unwrap();
        let mut decoder = Decoder::new();
        assert_eq!(decoder.push(&out[..n]), n);
        decoder.next_frame().unwrap().unwrap().packet().unwrap()
    };
    let of = |status, x| Packet { sensor_type: 2, sensor: 1, ..packet(status, x) };
    assert_eq!(reply(&mut ball), of(Status::Old, 0));
    ball.measure([7, 0, 0], [0; 3], Keys::NONE);
    assert_eq!(reply(&mut ball), of(Status::Fresh, 7));
    assert_eq!(reply(&mut ball), of(Status::Old, 7));
    assert_eq!((ball.statistics().fresh, ball.statistics().old), (1, 2));
}

#[test]
fn the_ball_sends_nothing_unasked_and_answers_once() {
    let (mut ball, mut out) = (Ball::new(BallConfig::default()).unwrap(), [0; 64]);
    ball.handle_connected(MS);
    ball.measure([1; 3], [2; 3], Keys(3));
    ball.handle_timeout(MS);
    assert_eq!((ball.poll_transmit(MS, &mut out), ball.poll_timeout()), (None, None));
    ball.handle_input(MS, &[0x07, 0x05, 0x05]);
    assert_eq!(ball.poll_transmit(MS, &mut out[..11]), None);
    // A reply contains the values that were measured before it is sent.
    ball.measure([4; 3], [5; 3], Keys(6));
    assert_eq!(ball.poll_transmit(MS, &mut out), Some(12));
    assert_eq!(ball.poll_transmit(MS, &mut out), None);
    let reply = Packet { force: [4; 3], moment: [5; 3], keys: Keys(6), ..fresh(0) };
    assert_eq!(events(&mut ball), [BallEvent::Unknown(7), BallEvent::Ignored, BallEvent::Reply(reply)]);
    assert_eq!((ball.statistics().unknown, ball.statistics().ignored), (1, 1));
}

#[test]
fn a_poll_is_not_answered_on_the_next_connection() {
    let mut ball = Ball::new(BallConfig::default()).unwrap();
    ball.handle_connected(MS);
    ball.measure([1; 3], [0; 3], Keys::NONE);
    ball.handle_input(MS, &[0x05]);
    ball.handle_disconnected(MS);
    assert_eq!(ball.poll_transmit(MS, &mut [0; 12]), None);
    ball.handle_connected(MS);
    assert_eq!(ball.poll_transmit(MS, &mut [0; 12]), None);
    ball.handle_input(MS, &[0x05]);
    assert_eq!(ball.poll_transmit(MS, &mut [0; 12]), Some(12));
    assert_eq!(ball.statistics().fresh, 1, "the values outlast the connection");
}

#[test]
fn a_full_event_queue_drops_the_oldest_notice() {
    let mut ball = Ball::new(BallConfig::default()).unwrap();
    ball.handle_input(MS, &[10, 11, 12, 13, 14, 15, 16, 17, 18, 19]);
    assert_eq!(events(&mut ball), [12, 13, 14, 15, 16, 17, 18, 19].map(BallEvent::Unknown));
    assert_eq!(ball.statistics().dropped_notices, 2);
}

#[test]
fn a_period_or_an_age_that_cannot_be_kept_is_refused() {
    let with = |baud, period, max_age| {
        Host::new(HostConfig { baud, period, max_age, ..HostConfig::default() })
            .map(drop)
            .map_err(|e| e.to_string())
    };
    let error = with(9600, MS * 13, MS * 150);
    assert_eq!(error, Err("poll period 13ms is shorter than 14ms, the time of a poll and its packet".into()));
    assert_eq!(with(9600, MS * 14, MS * 150), Ok(()));
    assert_eq!(with(19_200, MS * 7, MS * 150), Ok(()));
    // Twice 28 ms from poll to poll, 27.541 ms until the reply.
    let error = with(9600, MS * 28, Duration::from_nanos(83_541_666));
    let text = "the maximum age 83.541666ms must be above 83.541666ms, the age reached between two replies";
    assert_eq!(error, Err(text.into()));
    assert_eq!(with(9600, MS * 28, Duration::from_nanos(83_541_667)), Ok(()));
    assert!(with(0, MS * 28, MS * 150).is_err());
    assert!(with(9600, Duration::MAX, MS * 150).is_err());
    assert_eq!(with(9600, Duration::MAX, Duration::MAX), Ok(()));
    let ball = |sensor_type, sensor| Ball::new(BallConfig { sensor_type, sensor, ..BallConfig::default() });
    assert_eq!(ball(8, 0).unwrap_err().to_string(), "sensor type 8 is not in 0..=7");
    assert_eq!(ball(0, 9).unwrap_err(), ConfigError::Identity(EncodeError::Sensor { found: 9 }));
}

#[test]
fn the_longest_time_is_never() {
    let mut host = Host::new(HostConfig::default()).unwrap();
    host.handle_connected(Duration::MAX);
    assert_eq!((host.poll_timeout(), host.poll_transmit(Duration::MAX, &mut [0])), (None, None));
    host.handle_input(Duration::MAX, &bytes(fresh(1)));
    host.handle_disconnected(Duration::MAX);
    host.handle_connected(Duration::ZERO);
    assert_eq!(host.poll_transmit(Duration::MAX, &mut [0]), Some(1));
    assert_eq!(host.poll_transmit(Duration::MAX, &mut [0]), None);
}

#[test]
fn the_line_takes_as_long_as_the_source_says() {
    assert_eq!(timing::exchange_time(9600).as_micros(), 13_541);
    assert_eq!(timing::min_period(9600), MS * 14);
    assert_eq!(timing::min_period(19_200), MS * 7);
    assert_eq!(timing::min_period(13_000), MS * 10);
    assert_eq!(timing::transmission_time(12, 0), Duration::MAX);
}

#[test]
fn errors_read_as_a_sentence() {
    let text = |e: DecodeError| e.to_string();
    assert_eq!(
        text(DecodeError::Header { offset: 1, expected: 0xF8, found: 0x11 }),
        "no packet header: byte 1 is 0x11, not 0xf8"
    );
    assert_eq!(text(DecodeError::Noise { length: 3 }), "3 bytes without a packet header");
    assert_eq!(
        text(DecodeError::Checksum { offset: 11, expected: 0x7A, found: 0x7B }),
        "checksum is 0x7b, the data gives 0x7a (at byte 11)"
    );
    assert_eq!(text(DecodeError::Incomplete { expected: 12, found: 9 }), "packet ends after 9 of 12 bytes");
    assert_eq!(
        text(DecodeError::Layout { expected: 8, found: 9 }),
        "packet has 9 data bytes, only the layout of 8 is known"
    );
    let small = fresh(0).encode(&mut [0; 11]).unwrap_err();
    assert_eq!(small.to_string(), "output has room for 11 bytes, 12 are needed");
}
