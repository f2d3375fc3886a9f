//! The workstation whose request is lost, on a virtual clock.

use core::time::Duration;

use cellwire_sim::viewer::WorkstationCounts;
use cellwire_sim::{Bench, Device as _, Fault, Script, Settings as _, SimulatorReport, Viewer};
use val2_viewer::{Host, HostConfig, WorkstationConfig, WorkstationEvent};

use crate::gadget::Line;

const S: Duration = Duration::from_secs(1);

#[test]
fn a_lost_request_and_a_lost_pose_do_not_stop_the_picture() {
    let mut bench = Viewer::default().bench(Host::new(HostConfig::default()).unwrap()).unwrap();
    bench.wire.baud = Some(9600);
    bench.faults().follow(Script::new().answer(50, Fault::Drop).request(100, Fault::Drop));
    for tick in 0..6000u64 {
        let now = bench.now();
        bench.session_mut().set_pose(now, [i16::try_from(tick).unwrap(); 12]);
        bench.run_for(S / 50);
    }
    let drawn = bench.device().drawn();
    assert!(drawn.poses > 500 && drawn.gaps == 1 && drawn.most_at_once == 1, "{drawn:?}");
    let last = bench.executed().last().unwrap();
    assert!(last.at > 119 * S && last.work.pose[0] > 5900, "{last:?}");
    let gaps = bench.executed().windows(2).map(|two| two[1].at - two[0].at);
    assert!(gaps.into_iter().all(|gap| gap < 5 * S), "the picture was frozen");
    assert_eq!(bench.faults().happened().len(), 2);
}

/// Nobody answers: the operator pauses the picture, and the next one asks again.
#[test]
fn a_picture_that_is_older_than_it_may_be_is_paused() {
    let stale_after = 7 * S / 5;
    let viewer =
        Viewer { config: WorkstationConfig { stale_after, ..Default::default() }, ..Default::default() };
    let mut bench = Bench::new(Line::default(), viewer.simulator().unwrap());
    bench.wire.latency = Duration::ZERO;
    bench.run_for(8 * S);
    // Pictures come every 0.2 s, the first before there is a connection. That of 1.4 s is as old as it may be.
    assert_eq!(bench.session().log, ["0ns connected", "200ms \u{5}", "3.6s \u{5}", "7.2s \u{5}"]);
    assert_eq!(
        bench.device().drawn(),
        WorkstationCounts { asked: 3, pauses: 2, ..WorkstationCounts::default() }
    );
}

#[test]
fn what_was_drawn_is_counted() {
    let mut bench = Viewer::default().bench(Host::new(HostConfig::default()).unwrap()).unwrap();
    bench.faults().follow(Script::new().request(3, Fault::Twice).request(5, Fault::Corrupt));
    while bench.now() < 2 * S {
        let now = bench.now();
        bench.session_mut().set_pose(now, [1; 12]);
        bench.run_for(S / 50);
    }
    bench.run_for(2 * S);
    let told = |is: fn(&WorkstationEvent) -> bool| {
        let events = bench
            .told()
            .iter()
            .filter(|(_, told)| matches!(told, SimulatorReport::Device(event) if is(event)));
        events.count() as u64
    };
    let drawn = bench.device().drawn();
    assert_eq!(drawn.poses, bench.executed().len() as u64);
    assert_eq!(drawn.damaged, told(|event| matches!(event, WorkstationEvent::Corrupt(_))));
    assert_eq!(
        (told(|event| matches!(event, WorkstationEvent::Unasked(_))), drawn.stale),
        (1, 1),
        "{drawn:?}"
    );
    assert_eq!((drawn.gaps, drawn.most_at_once), (1, 2), "a pose that comes twice is not a gap");
    assert!(drawn.asked >= 10 && drawn.damaged > 0, "{drawn:?}");
}

#[test]
fn a_workstation_that_was_without_power_has_seen_nothing() {
    let mut bench = Viewer::default().bench(Host::new(HostConfig::default()).unwrap()).unwrap();
    bench.run_for(2 * S);
    assert_ne!(bench.device().drawn(), WorkstationCounts::default());
    let now = bench.now();
    bench.device_mut().restart(now);
    assert_eq!(bench.device().drawn(), WorkstationCounts::default());
}

/// A workstation whose requests have piled up while the host did not read finds one pose.
#[test]
fn requests_that_have_piled_up_have_one_pose() {
    use std::io::Write as _;
    use std::net::{TcpListener, TcpStream};
    use val2_viewer::robot_session::{Driver, Session as _, now};
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let mut workstation = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    let (stream, _) = listener.accept().unwrap();
    let config = HostConfig { interval: S / 1000, ..HostConfig::default() };
    let (mut host, mut driver) = (Host::new(config).unwrap(), Driver::new(stream));
    host.handle_connected(now());
    host.set_pose(now(), [1; 12]);
    // The interval is over: the first request that is read has an answer at once.
    std::thread::sleep(S / 100);
    workstation.write_all(&[0x05; 1000]).unwrap();
    let end = now() + S / 2;
    while now() < end {
        host.set_pose(now(), [1; 12]);
        let turn = driver.turn(&mut host, Some(S / 100), |_, _| core::ops::ControlFlow::<()>::Continue(()));
        assert!(turn.unwrap().is_continue());
    }
    let statistics = host.statistics();
    assert_eq!((statistics.sent, statistics.asked, statistics.ignored), (1, 1, 999));
}
