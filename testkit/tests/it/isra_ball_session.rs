//! Both ends of isra-ball on a simulated line.

use core::time::Duration;

use isra_ball::robot_session::Session as _;
use isra_ball::{Ball, BallConfig, Host, HostConfig, HostEvent, Keys, Packet, Status};
use testkit::link::{End, Faults, Link};
use testkit::turn;

const MS: Duration = Duration::from_millis(1);

fn packet(status: Status, x: i8) -> Packet {
    Packet { sensor_type: 0, sensor: 0, status, force: [x, 0, 0], moment: [0; 3], keys: Keys::NONE }
}

fn ends(config: BallConfig) -> (Host, Ball) {
    let (mut host, mut ball) = (Host::new(HostConfig::default()).unwrap(), Ball::new(config).unwrap());
    host.handle_connected(Duration::ZERO);
    ball.handle_connected(Duration::ZERO);
    (host, ball)
}

/// Drives a host at `End::A` and a ball at `End::B` until `end`. `hand` gives the sensor's values from time to time.
fn drive(
    link: &mut Link,
    host: &mut Host,
    ball: &mut Ball,
    end: Duration,
    mut hand: impl FnMut(Duration, &mut Ball),
) -> Vec<(Duration, HostEvent)> {
    let (mut now, mut events) = (Duration::ZERO, Vec::new());
    while now < end {
        hand(now, ball);
        turn(link, End::A, host, now, |_, event| events.push((now, event)));
        turn(link, End::B, ball, now, |_, _| {});
        let next = host.poll_timeout().into_iter().chain(link.next_delivery()).min().unwrap();
        now = next.max(now + Duration::from_micros(100));
    }
    events
}

#[test]
fn a_clean_line_gives_new_values_each_period() {
    let mut link = Link::new(1, Faults { latency: Duration::ZERO, ..Faults::NONE }.at_baud(9600));
    let (mut host, mut ball) = ends(BallConfig::default());
    let events = drive(&mut link, &mut host, &mut ball, MS * 2845, |now, ball| {
        ball.measure([(now.as_millis() % 100) as i8, 0, 0], [0; 3], Keys::NONE);
    });
    assert_eq!(events.len(), 100);
    let first = HostConfig::default().quiet();
    for (k, (at, event)) in (0..).zip(events) {
        let polled = first + 28 * MS * k;
        match event {
            HostEvent::Old(packet) => assert_eq!((packet.status, k), (Status::Fresh, 0)),
            other => assert!(
                matches!(other, HostEvent::Packet(p) if p.status == Status::Fresh),
                "{at:?} {other:?}"
            ),
        }
        // "ENQ" and 12 bytes at 9600 baud are 13.54 ms, passed on by the link in steps of 0.1 ms.
        let took = at - polled;
        assert!(took >= Duration::from_micros(13_541) && took < Duration::from_micros(13_900), "{took:?}");
    }
}

/// The thesis's ball repeats its values while its processor has no new ones (§4.2): nothing may follow them without limit.
#[test]
fn a_ball_that_cannot_measure_is_stale_until_it_can() {
    let mut link = Link::new(1, Faults::NONE.at_baud(9600));
    let (mut host, mut ball) = ends(BallConfig::default());
    // New values until 150 ms, then the same ones, then new ones again from 600 ms on.
    let events = drive(&mut link, &mut host, &mut ball, MS * 800, |now, ball| {
        if now < MS * 150 || now > MS * 600 {
            ball.measure([7, 0, 0], [0; 3], Keys::NONE);
        }
    });
    let at = |expected: HostEvent| {
        events.iter().filter(|(_, e)| *e == expected).map(|(at, _)| *at).collect::<Vec<_>>()
    };
    let new = at(HostEvent::Packet(packet(Status::Fresh, 7)));
    let stale = at(HostEvent::Stale);
    assert_eq!(stale.len(), 1, "{events:?}");
    assert!(stale[0] < MS * 300 && stale[0] > MS * 200, "{stale:?}");
    assert!(new.iter().all(|at| *at < MS * 180 || *at > MS * 600), "{new:?}");
    assert!(at(HostEvent::Old(packet(Status::Old, 7))).len() > 10);
    assert!(host.live_until().is_some());
}

#[test]
fn a_noisy_line_delivers_only_what_the_ball_measured() {
    let faults = Faults { latency: Duration::ZERO, ..Faults::SERIAL }.at_baud(9600);
    let (mut delivered, mut wrong, mut corruption) = (0, 0, 0);
    for seed in 0..40 {
        let mut link = Link::new(seed, faults);
        let (mut host, mut ball) = ends(BallConfig { sensor_type: 3, sensor: 4, ..BallConfig::default() });
        let mut n = 0u8;
        let events = drive(&mut link, &mut host, &mut ball, MS * 5000, |_, ball| {
            n = n.wrapping_add(1);
            let v = n.cast_signed();
            ball.measure([v, !v, v], [!v, v, !v], Keys(n));
        });
        for (_, event) in events {
            if let HostEvent::Packet(p) | HostEvent::Old(p) | HostEvent::Unasked(p) = event {
                let v = p.force[0];
                let good = p.force == [v, !v, v] && p.moment == [!v, v, !v] && p.keys.0 == v.cast_unsigned();
                delivered += 1;
                wrong += u32::from(!good || (p.sensor_type, p.sensor) != (3, 4));
            }
        }
        corruption += link.counts().corruption();
    }
    // The poll after one without a reply is later.
    assert!(delivered > 6300 && corruption > 200, "{delivered} packets, {corruption} faults");
    // A one-byte sum lets 1 in 256 corrupt packets through.
    assert!(wrong <= 3, "{wrong} of {delivered}");
}
