//! The ball that falls silent, on a virtual clock.

use core::time::Duration;

use cellwire_sim::ball::grip;
use cellwire_sim::{Fault, Script, Settings as _, TeachBall, Told};
use isra_ball::{BallEvent, Host, HostConfig, HostEvent};

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
                // What the hand did within the time that the reply takes.
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
    let replies = bench.told().iter().filter(|(_, told)| matches!(told, Told::Device(BallEvent::Reply(_))));
    assert!(replies.count() >= fresh, "the ball tells of each reply");
    assert_eq!(stale, [60], "the values were too old once, while it was silent");
}
