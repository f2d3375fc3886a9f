//! Both ends on a simulated line, the state tables, and every rule of the source.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use core::fmt::Debug;
use core::time::Duration;

use isra_ball::state::{Poll, PollInput, Reply, ReplyInput, Sensor, SensorInput};
use isra_ball::{
    Axes, Ball, BallEvent, Config, DecodeError, Decoder, Edges, EncodeError, Filter, Host, HostEvent,
    KeyEdges, Keys, Packet, SessionError, Status, timing,
};
use testkit::link::{Delivery, End, Faults, Link};

const MS: Duration = Duration::from_millis(1);

fn packet(status: Status, x: i8) -> Packet {
    Packet { sensor_type: 0, sensor: 0, status, force: [x, 0, 0], moment: [0; 3], keys: Keys::NONE }
}

/// A host at `End::A` and a ball at `End::B`, driven until `end`. `hand` gives the sensor's values from time to time.
fn drive(
    link: &mut Link,
    host: &mut Host,
    ball: &mut Ball,
    end: Duration,
    mut hand: impl FnMut(Duration, &mut Ball),
) -> Vec<(Duration, HostEvent)> {
    let (mut now, mut out, mut events) = (Duration::ZERO, [0; 64], Vec::new());
    while now < end {
        hand(now, ball);
        host.handle_timeout(now);
        while let Some(Delivery::Bytes(bytes)) = link.receive(End::A, now) {
            host.handle_input(now, &bytes);
        }
        while let Some(Delivery::Bytes(bytes)) = link.receive(End::B, now) {
            ball.handle_input(now, &bytes);
        }
        while let Some(n) = host.poll_transmit(now, &mut out) {
            link.send(End::A, now, &out[..n]);
        }
        while let Some(n) = ball.poll_transmit(now, &mut out) {
            link.send(End::B, now, &out[..n]);
        }
        events.extend(core::iter::from_fn(|| host.poll_event()).map(|event| (now, event)));
        while ball.poll_event().is_some() {}
        let next = host.poll_timeout().into_iter().chain(link.next_delivery()).min().unwrap();
        now = next.max(now + Duration::from_micros(100));
    }
    events
}

fn matrix<S: Copy + Debug, I: Copy + Debug, A: Debug>(
    states: [S; 2],
    inputs: [I; 2],
    on: fn(S, I) -> (S, A),
) -> String {
    let rows = states.iter().flat_map(|s| inputs.iter().map(move |i| (s, i)));
    rows.map(|(s, i)| {
        let (next, action) = on(*s, *i);
        format!("{s:?} × {i:?} -> {next:?}, {action:?}\n")
    })
    .collect()
}

#[test]
fn every_state_and_event_is_defined() {
    let text = matrix([Poll::Idle, Poll::Waiting], [PollInput::PollDue, PollInput::Packet], Poll::on)
        + &matrix([Sensor::Alive, Sensor::Stale], [SensorInput::Fresh, SensorInput::Silence], Sensor::on)
        + &matrix([Reply::Ready, Reply::Replying], [ReplyInput::Enq, ReplyInput::Sent], Reply::on);
    assert_eq!(text, include_str!("state_matrix.txt"));
}

#[test]
fn a_clean_line_gives_a_fresh_packet_each_period() {
    let mut link = Link::new(1, Faults { latency: Duration::ZERO, ..Faults::NONE }.at_baud(9600));
    let (mut host, mut ball) = (Host::new(Config::default()).unwrap(), Ball::new(0, 0).unwrap());
    let events = drive(&mut link, &mut host, &mut ball, MS * 2800, |now, ball| {
        ball.measure([(now.as_millis() % 100) as i8, 0, 0], [0; 3], Keys::NONE);
    });
    assert_eq!(events.len(), 100);
    for (k, (at, event)) in (0..).zip(events) {
        let asked = 28 * MS * k;
        assert!(matches!(event, HostEvent::Packet(p) if p.status == Status::Fresh), "{at:?} {event:?}");
        // "ENQ" and 12 bytes at 9600 baud are 13.54 ms, told by the link in steps of 0.1 ms.
        let took = at - asked;
        assert!(took >= Duration::from_micros(13_541) && took < Duration::from_micros(13_900), "{took:?}");
    }
}

/// §4.2: "Daten in Ordnung" and "alte Daten": the ball's processor has no new values yet and sends the ones before.
#[test]
fn values_asked_for_twice_are_old_the_second_time() {
    let mut ball = Ball::new(2, 1).unwrap();
    let reply = |ball: &mut Ball| {
        let mut out = [0; 64];
        ball.handle_input(Duration::ZERO, &[0x05]);
        let n = ball.poll_transmit(Duration::ZERO, &mut out).unwrap();
        let mut decoder = Decoder::new();
        decoder.push(&out[..n]);
        decoder.next_frame().unwrap().unwrap().packet().unwrap()
    };
    let old = |status, x| Packet { sensor_type: 2, sensor: 1, ..packet(status, x) };
    assert_eq!(reply(&mut ball), old(Status::Old, 0));
    ball.measure([7, 0, 0], [0; 3], Keys::NONE);
    assert_eq!(reply(&mut ball), old(Status::Fresh, 7));
    assert_eq!(reply(&mut ball), old(Status::Old, 7));
}

#[test]
fn old_values_are_used_but_do_not_show_that_the_sensor_lives() {
    let mut link = Link::new(1, Faults::NONE.at_baud(9600));
    let (mut host, mut ball) = (Host::new(Config::default()).unwrap(), Ball::new(0, 0).unwrap());
    // New values until 50 ms, then the same ones, then new ones again from 300 ms on.
    let events = drive(&mut link, &mut host, &mut ball, MS * 400, |now, ball| {
        if now < MS * 50 || now > MS * 300 {
            ball.measure([7, 0, 0], [0; 3], Keys::NONE);
        }
    });
    let stale: Vec<_> = events.iter().filter(|(_, e)| *e == HostEvent::Stale).collect();
    assert_eq!(stale.len(), 1, "{events:?}");
    let last_fresh =
        events.iter().rfind(|(at, e)| *at < stale[0].0 && *e == HostEvent::Packet(packet(Status::Fresh, 7)));
    assert_eq!(stale[0].0 - last_fresh.unwrap().0, MS * 100);
    let old = HostEvent::Packet(packet(Status::Old, 7));
    assert!(events.iter().filter(|(_, e)| *e == old).count() > 5, "{events:?}");
    assert!(host.is_alive());
}

#[test]
fn a_dead_ball_is_missed_each_period_and_stale_once() {
    let mut host = Host::new(Config::default()).unwrap();
    let (mut out, mut events, mut polls) = ([0; 4], Vec::new(), Vec::new());
    for now in (0..300).map(|t| MS * t) {
        host.handle_timeout(now);
        if host.poll_transmit(now, &mut out).is_some() {
            assert_eq!(out[0], 0x05);
            polls.push(now.as_millis());
        }
        events.extend(core::iter::from_fn(|| host.poll_event()).map(|event| (now.as_millis(), event)));
    }
    assert_eq!(polls, [0, 28, 56, 84, 112, 140, 168, 196, 224, 252, 280]);
    let missed: Vec<_> = events.iter().filter(|(_, e)| *e == HostEvent::Missed).map(|(at, _)| *at).collect();
    assert_eq!(missed, polls[1..]);
    let stale: Vec<_> = events.iter().filter(|(_, e)| *e == HostEvent::Stale).map(|(at, _)| *at).collect();
    assert_eq!(stale, [100]);
    assert!(!host.is_alive());
}

#[test]
fn a_pause_of_the_host_is_not_made_up_for_by_a_burst() {
    let mut host = Host::new(Config::default()).unwrap();
    let mut polls = Vec::new();
    for t in (0..30).chain(500..600) {
        if host.poll_transmit(MS * t, &mut [0]).is_some() {
            polls.push(t);
        }
    }
    assert_eq!(polls, [0, 28, 500, 514, 542, 570, 598]);
    let mut host = Host::new(Config::default()).unwrap();
    assert_eq!(host.poll_transmit(MS, &mut []), None);
    assert_eq!(host.poll_transmit(MS, &mut [0]), Some(1));
}

#[test]
fn a_late_reply_is_told_apart() {
    let mut host = Host::new(Config::default()).unwrap();
    let (a, b) = (packet(Status::Fresh, 1), packet(Status::Fresh, 2));
    host.poll_transmit(Duration::ZERO, &mut [0]).unwrap();
    host.poll_transmit(MS * 28, &mut [0]).unwrap();
    host.handle_input(MS * 29, &[a.to_bytes().unwrap(), b.to_bytes().unwrap()].concat());
    let events: Vec<_> = core::iter::from_fn(|| host.poll_event()).collect();
    assert_eq!(events, [HostEvent::Missed, HostEvent::Packet(a), HostEvent::Unasked(b)]);
}

#[test]
fn a_cut_reply_is_given_up_at_the_next_poll() {
    let mut host = Host::new(Config::default()).unwrap();
    let bytes = packet(Status::Fresh, 1).to_bytes().unwrap();
    host.poll_transmit(Duration::ZERO, &mut [0]).unwrap();
    host.handle_input(MS * 10, &bytes[..9]);
    assert_eq!(host.poll_event(), None);
    host.poll_transmit(MS * 28, &mut [0]).unwrap();
    host.handle_input(MS * 40, &bytes);
    let events: Vec<_> = core::iter::from_fn(|| host.poll_event()).collect();
    let cut = HostEvent::Error(DecodeError::Incomplete { expected: 12, found: 9 });
    assert_eq!(events, [cut, HostEvent::Missed, HostEvent::Packet(packet(Status::Fresh, 1))]);
}

/// §4.1: "integriertem XON/XOFF Software-Handshake", and the packets are unescaped binary.
#[test]
fn a_line_with_xon_xoff_loses_forces_of_17_and_19_and_a_raw_one_does_not() {
    let trap =
        Packet { force: [17, 19, -128], moment: [127, 0, 0], keys: Keys(0x10), ..packet(Status::Fresh, 0) };
    let plain = packet(Status::Fresh, 5);
    let reply = |xon_xoff: bool| {
        let mut host = Host::new(Config::default()).unwrap();
        for (k, packet) in (0..).zip([trap, plain, trap, plain]) {
            host.poll_transmit(MS * 28 * k, &mut [0]).unwrap();
            let mut bytes = packet.to_bytes().unwrap().to_vec();
            bytes.retain(|byte| !xon_xoff || ![0x11, 0x13].contains(byte));
            host.handle_input(MS * (28 * k + 14), &bytes);
        }
        core::iter::from_fn(|| host.poll_event()).collect::<Vec<_>>()
    };
    assert_eq!(reply(false), [trap, plain, trap, plain].map(HostEvent::Packet));
    let short = HostEvent::Error(DecodeError::Incomplete { expected: 12, found: 10 });
    let good = HostEvent::Packet(plain);
    assert_eq!(reply(true), [short, HostEvent::Missed, good, short, HostEvent::Missed, good]);
}

#[test]
fn a_noisy_line_delivers_only_what_the_ball_measured() {
    let faults = Faults { latency: Duration::ZERO, ..Faults::SERIAL }.at_baud(9600);
    let (mut delivered, mut wrong, mut damage) = (0, 0, 0);
    for seed in 0..40 {
        let mut link = Link::new(seed, faults);
        let (mut host, mut ball) = (Host::new(Config::default()).unwrap(), Ball::new(3, 4).unwrap());
        let mut n = 0u8;
        let events = drive(&mut link, &mut host, &mut ball, MS * 5000, |_, ball| {
            n = n.wrapping_add(1);
            let v = n.cast_signed();
            ball.measure([v, !v, v], [!v, v, !v], Keys(n));
        });
        for (_, event) in events {
            if let HostEvent::Packet(p) | HostEvent::Unasked(p) = event {
                let v = p.force[0];
                let good = p.force == [v, !v, v] && p.moment == [!v, v, !v] && p.keys.0 == v.cast_unsigned();
                delivered += 1;
                wrong += u32::from(!good || (p.sensor_type, p.sensor) != (3, 4));
            }
        }
        damage += link.counts().damage();
    }
    assert!(delivered > 6500 && damage > 200, "{delivered} packets, {damage} faults");
    // A one-byte sum lets 1 in 256 damaged packets through.
    assert!(wrong <= 3, "{wrong} of {delivered}");
}

#[test]
fn a_period_that_the_line_cannot_keep_is_refused() {
    let config = Config { period: MS * 13, ..Config::default() };
    let error = Host::new(config).unwrap_err();
    assert_eq!(error, SessionError::Period { minimum: MS * 14, found: MS * 13 });
    assert_eq!(
        error.to_string(),
        "poll period 13ms is shorter than the 14ms that a poll and its packet take"
    );
    assert!(Host::new(Config { period: MS * 14, ..Config::default() }).is_ok());
    assert!(Host::new(Config { period: MS * 7, baud: 19_200, ..Config::default() }).is_ok());
    assert!(matches!(Host::new(Config { baud: 0, ..Config::default() }), Err(SessionError::Period { .. })));
    assert_eq!(Ball::new(8, 0).unwrap_err().to_string(), "sensor type 8 is not in 0..=7");
    assert_eq!(Ball::new(0, 9).unwrap_err(), SessionError::Identity(EncodeError::Sensor { found: 9 }));
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
fn the_ball_says_nothing_unasked_and_answers_once() {
    let (mut ball, mut out) = (Ball::new(0, 0).unwrap(), [0; 64]);
    ball.measure([1; 3], [2; 3], Keys(3));
    ball.handle_timeout(MS);
    assert_eq!((ball.poll_transmit(MS, &mut out), ball.poll_timeout()), (None, None));
    ball.handle_input(MS, &[0x07, 0x05, 0x05]);
    assert_eq!(ball.poll_transmit(MS, &mut out[..11]), None);
    assert_eq!(ball.poll_transmit(MS, &mut out), Some(12));
    assert_eq!(ball.poll_transmit(MS, &mut out), None);
    let events: Vec<_> = core::iter::from_fn(|| ball.poll_event()).collect();
    let reply = Packet { force: [1; 3], moment: [2; 3], keys: Keys(3), ..packet(Status::Fresh, 0) };
    assert_eq!(events, [BallEvent::Unknown(7), BallEvent::Reply(reply), BallEvent::Ignored]);
}

#[test]
fn a_full_event_queue_gives_up_its_oldest() {
    let mut ball = Ball::new(0, 0).unwrap();
    ball.handle_input(MS, &[10, 11, 12, 13, 14, 15, 16, 17, 18, 19]);
    let events: Vec<_> = core::iter::from_fn(|| ball.poll_event()).collect();
    assert_eq!(events, [12, 13, 14, 15, 16, 17, 18, 19].map(BallEvent::Unknown));
    assert_eq!(ball.dropped_events(), 2);
}

#[test]
fn a_key_held_from_the_start_is_no_edge() {
    let mut edges = KeyEdges::new();
    assert_eq!(edges.update(Keys(0b1000_0001)), Edges::default());
    assert_eq!(edges.update(Keys(0b1000_0010)), Edges { pressed: Keys(2), released: Keys(1) });
    assert_eq!(edges.update(Keys(0b1000_0010)), Edges::default());
    assert_eq!(edges.update(Keys::NONE), Edges { pressed: Keys::NONE, released: Keys(0b1000_0010) });
    assert_eq!(Keys(0x81).iter().collect::<Vec<_>>(), [1, 8]);
    assert_eq!(Keys::NONE.with(1).with(8).with(0).with(9), Keys(0x81));
    assert!(Keys(0x10).is_down(5) && !Keys(0xFF).is_down(0) && !Keys(0xFF).is_down(9));
}

/// §4: ROT "nur der rotatorische Anteil", TRA "nur der translatorische Anteil", DOM "nur die jeweils dominierende Komponente";
/// with ROT or TRA that of its half.
#[test]
fn the_filter_keeps_the_truth_table() {
    let axes = [3, -90, 4, 5, -100, 100];
    let table = [
        ((false, false, false), axes),
        ((true, false, false), [3, -90, 4, 0, 0, 0]),
        ((false, true, false), [0, 0, 0, 5, -100, 100]),
        ((false, false, true), [0, 0, 0, 0, -100, 0]),
        ((true, false, true), [0, -90, 0, 0, 0, 0]),
        ((false, true, true), [0, 0, 0, 0, -100, 0]),
        ((true, true, false), axes),
        ((true, true, true), [0, 0, 0, 0, -100, 0]),
    ];
    for ((tra, rot, dom), passed) in table {
        assert_eq!(Filter::from_keys(tra, rot, dom).apply(axes), passed, "{tra} {rot} {dom}");
    }
    let dominant = Filter { axes: Axes::All, dominant: true };
    assert_eq!(dominant.apply([127, -128, 0, 0, 0, 0]), [0, -128, 0, 0, 0, 0]);
    assert_eq!(dominant.apply([0; 6]), [0; 6]);
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
        "packet has 9 data bytes, the layout of 8 is known"
    );
    let small = packet(Status::Fresh, 0).encode(&mut [0; 11]).unwrap_err();
    assert_eq!(small.to_string(), "output has room for 11 bytes, 12 are needed");
}
