//! The counters and errors of each end, and a line that takes bytes away.
//! The rules are the stories of `reference/sessions/isra-ball.json`.

use core::time::Duration;

use isra_ball::robot_session::{Decoder as _, Encode as _, Session};
use isra_ball::{
    Ball, BallConfig, BallEvent, ConfigError, DecodeError, Decoder, EncodeError, Host, HostConfig, HostEvent,
    Keys, Packet, Status,
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
