//! A robot that misbehaves under ALTER: over TCP, and for a quarter of an hour on a virtual clock.

use core::time::Duration;

use cellwire_sim::puma::{Incident, PumaEvent};
use cellwire_sim::{Fault, Puma, Script, Settings as _, Told};
use val2_alter::robot_session::tokio::Tcp;
use val2_alter::{ErrorCode, Host, HostConfig, HostEvent};

const MS: Duration = Duration::from_millis(1);
const S: Duration = Duration::from_secs(1);

#[tokio::test]
async fn an_arm_goes_on_after_a_lost_reply_and_stands_still_in_between() {
    let sim = Puma { restart: 50 * MS, ..Puma::default() }.listen("127.0.0.1:0").unwrap();
    let to = Tcp::new(sim.address().to_string());
    let (arm, task) = val2_alter::tokio::host(HostConfig::default(), None, to).unwrap();
    tokio::spawn(task.run());
    let moved = |least: usize| {
        let (arm, sim) = (&arm, &sim);
        async move {
            while sim.executed().len() < least {
                arm.set_target([8, 0, 0, 0, 0, 0]);
                tokio::time::sleep(5 * MS).await;
            }
        }
    };
    moved(20).await;
    sim.faults().next_request(Fault::Drop);
    moved(60).await;
    arm.stop().await.unwrap();
    let starts = |what: fn(&PumaEvent) -> bool| {
        sim.told().iter().filter(|(_, told)| matches!(told, Told::Device(event) if what(event))).count()
    };
    assert!(starts(|event| matches!(event, PumaEvent::Started(_))) >= 2);
    assert!(starts(|event| matches!(event, PumaEvent::Ended(ErrorCode::Timeout, _))) >= 1);
    // 8 units are a quarter of a millimetre a cycle, along x alone.
    let done = sim.executed();
    let way: f64 = done.iter().map(|moved| f64::from(moved.work.values[0]) / 32.0).sum();
    assert!((done.last().unwrap().work.pose.p[0] - 400.0 - way).abs() < 1e-6 && way > 5.0);
}

#[test]
fn a_quarter_of_an_hour_of_cycles() {
    let incidents = vec![(2 * S, Incident::Interrupt(S)), (5 * S, Incident::Misread(ErrorCode::Checksum))];
    let mut bench =
        Puma { incidents, ..Puma::default() }.bench(Host::new(HostConfig::default()).unwrap()).unwrap();
    bench.faults().follow(Script::new().answer(5000, Fault::Drop).answer(9000, Fault::Cut));
    let (mut starts, mut bad) = (0, 0);
    while bench.now() < 900 * S {
        let now = bench.now();
        bench.session_mut().set_target(now, [1, 0, 0, 0, 0, 0]);
        bench.run_for(100 * MS);
        for event in bench.take_events() {
            match event {
                HostEvent::Start(_) => starts += 1,
                HostEvent::Motion(motion) if motion.error == ErrorCode::Checksum => bad += 1,
                _ => {}
            }
        }
    }
    assert_eq!((starts, bad), (3, 1), "{:?}", bench.told());
    let incidents =
        bench.told().iter().filter(|(_, told)| matches!(told, Told::Device(PumaEvent::Incident(_))));
    assert_eq!(incidents.count(), 2);
    // A cycle is 28 ms; of 900 s the starts, the pauses and the interruption are missing.
    let done = bench.executed();
    assert!((31_800..32_143).contains(&done.len()), "{}", done.len());
    assert!(done.windows(2).all(|two| two[1].at - two[0].at >= 27 * MS));
}
