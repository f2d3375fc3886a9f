//! The ball that falls silent, on a virtual clock.

use core::time::Duration;

use cellwire_sim::ball::{Grip, HeldBall, grip};
use cellwire_sim::robot_session::Session as _;
use cellwire_sim::{Bench, Device as _, Fault, Script, Settings as _, SimulatorReport, TeachBall};
use isra_ball::{BallEvent, Host, HostConfig, HostEvent, Keys};

const S: Duration = Duration::from_secs(1);

#[test]
fn ten_minutes_of_polls_with_a_silence() {
    let mut bench = TeachBall::default().bench(Host::new(HostConfig::default()).unwrap()).unwrap();
    bench.wire.baud = Some(9600);
    bench.faults().follow(Script::new().every_answer(500, Fault::Corrupt).at(60 * S, Fault::Freeze(S)));
    let (mut fresh, mut missed, mut stale) = (0, 0, Vec::new());
    while bench.now() < 600 * S {
        match bench.next_event(S) {
            Some(HostEvent::Packet(packet)) => {
                fresh += 1;
                // The hand's grips within the time that the reply takes.
                let now = bench.now();
                let near = (0..=40).map(|ms| grip(now.saturating_sub(Duration::from_millis(ms))));
                assert!(near.into_iter().any(|grip| grip.keys == packet.keys), "{packet:?} at {now:?}");
            }
            Some(HostEvent::Missed) => missed += 1,
            Some(HostEvent::Stale) => stale.push(bench.now().as_secs()),
            Some(_) => {}
            None => panic!("no poll within a second"),
        }
    }
    assert!(fresh > 20_000 && (30..120).contains(&missed), "{fresh} {missed}");
    let replies =
        bench.told().iter().filter(|(_, told)| matches!(told, SimulatorReport::Device(BallEvent::Reply(_))));
    assert!(replies.count() >= fresh, "the ball tells of each reply");
    assert_eq!(stale, [60], "the values were too old once, while it was silent");
}

#[test]
fn a_grip_that_is_set_is_measured_until_the_hand_goes_on() {
    let mut bench = TeachBall::default().bench(Host::new(HostConfig::default()).unwrap()).unwrap();
    bench.wire.baud = Some(9600);
    let held = Grip { force: [1, -2, 3], moment: [-4, 5, -6], keys: Keys::NONE.with(2).with(8) };
    bench.run_for(S);
    bench.device_mut().hold(Some(held));
    bench.run_for(S);
    drop(bench.take_events());
    bench.run_for(3 * S);
    let grips = |bench: &mut Bench<Host, HeldBall>| {
        let packets = bench.take_events().filter_map(|event| match event {
            HostEvent::Packet(packet) => {
                Some(Grip { force: packet.force, moment: packet.moment, keys: packet.keys })
            }
            _ => None,
        });
        packets.collect::<Vec<_>>()
    };
    let seen = grips(&mut bench);
    assert!(seen.len() > 50 && seen.iter().all(|seen| *seen == held), "{seen:?}");
    assert_eq!(bench.device().grip(), held);
    bench.device_mut().hold(None);
    bench.run_for(7 * S);
    assert!(grips(&mut bench).iter().filter(|seen| **seen != held).count() > 100);
}

/// Force, moment and keys in thousandths of a second, in the first round.
const HAND: [(u64, [i8; 6], u8); 26] = [
    (0, [0; 6], 0),
    (790, [-1; 6], 0),
    (950, [16, 38, 0, 0, 0, 0], 0),
    (1000, [27, 24, 0, 0, 0, 0], 0),
    (1100, [56, -23, 1, 1, 1, 1], 0),
    (1500, [110, 24, 0, 0, 0, 0], 0),
    (1750, [111, -23, 1, 1, 1, 1], 0),
    (1850, [1; 6], 0),
    (2250, [-1; 6], 1),
    (2400, [1; 6], 0),
    (2950, [0, 0, 2, 0, 0, -13], 0),
    (3050, [0, 0, 15, 0, 0, -77], 0),
    (3300, [1, 1, 31, 1, 1, -89], 0),
    (3450, [0, 0, 0, 0, 0, 90], 0),
    (3850, [1; 6], 0),
    (4300, [127, -127, 91, -99, 61, 127], 0),
    (4500, [127, -128, 90, -100, 60, 127], 0),
    (5050, [0; 6], 0),
    (5500, [0, -12, 0, 0, 0, 0], 0),
    (5700, [-1, -69, -1, -1, -1, -1], 0),
    (5850, [1, -79, 1, 1, 1, 1], 2),
    (6000, [0, -80, 0, 0, 0, 0], 0),
    (6300, [1, -79, 1, 1, 1, 1], 0),
    (6450, [0; 6], 0),
    (6900, [-1; 6], 0),
    (6995, [0; 6], 0),
];

#[test]
fn the_hand_does_the_same_in_every_round_once_one_way_and_once_the_other() {
    let check = |ms, [x, y, z, mx, my, mz]: [i8; 6], keys| {
        let Grip { force, moment, keys: down } = grip(Duration::from_millis(ms));
        assert_eq!((force, moment, down.0), ([x, y, z], [mx, my, mz], keys), "{ms} ms");
    };
    for (ms, axes, keys) in HAND {
        check(ms, axes, keys);
        check(ms + 14_000, axes, keys);
    }
    // The springs tremble as before.
    check(7_950, [-16, -38, 0, 0, 0, 0], 0);
    check(9_250, [-1; 6], 1);
    check(11_300, [-126, 127, -89, 101, -59, -126], 0);
    check(12_700, [-1, 67, -1, -1, -1, -1], 0);
}

#[test]
fn a_ball_that_was_without_power_begins_as_a_new_one() {
    let mut bench = TeachBall::default().bench(Host::new(HostConfig::default()).unwrap()).unwrap();
    bench.run_for(S);
    let new = TeachBall::default().device().unwrap().session().statistics();
    assert_ne!(bench.device().session().statistics(), new);
    let now = bench.now();
    bench.device_mut().restart(now);
    assert_eq!(bench.device().session().statistics(), new);
}

/// A host that has not read its port for a while finds one answer, however many polls it has sent.
#[test]
fn polls_that_have_piled_up_have_one_answer() {
    use std::io::{Read as _, Write as _};
    let sim = TeachBall::default().listen("127.0.0.1:0").unwrap();
    let mut host = std::net::TcpStream::connect(sim.address()).unwrap();
    host.write_all(&[0x05; 1000]).unwrap();
    host.set_read_timeout(Some(S / 2)).unwrap();
    let mut answers = Vec::new();
    let mut piece = [0; 256];
    while let Ok(length @ 1..) = host.read(&mut piece) {
        answers.extend_from_slice(&piece[..length]);
    }
    assert_eq!(answers.len(), 12, "{answers:02x?}");
}
