//! A robot that misbehaves under ALTER: over TCP, and for a quarter of an hour on a virtual clock.

use core::time::Duration;

use cellwire_sim::puma::{Incident, Layout, MarkIii, Pose, PumaEvent};
use cellwire_sim::robot_session::Session as _;
use cellwire_sim::{Bench, Device as _, Fault, Puma, Script, Settings as _, SimulatorReport};
use val2_alter::robot_session::tokio::Tcp;
use val2_alter::{
    ControllerStatistics, CoordinateFrame, ErrorCode, Exception, Host, HostConfig, HostEvent, MotionPhase,
    Policy, SegmentStatus,
};

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
        sim.told()
            .iter()
            .filter(|(_, told)| matches!(told, SimulatorReport::Device(event) if what(event)))
            .count()
    };
    assert!(starts(|event| matches!(event, PumaEvent::Started(_))) >= 2);
    assert!(starts(|event| matches!(event, PumaEvent::Ended(ErrorCode::Timeout, _))) >= 1);
    // 8 units are a quarter of a millimetre a cycle, along x alone.
    let done = sim.executed();
    let way: f64 = done.iter().map(|moved| f64::from(moved.work.values[0]) / 32.0).sum();
    assert!((done.last().unwrap().work.pose.p[0] - 400.0 - way).abs() < 1e-6 && way > 5.0);
}

#[test]
fn an_incident_that_is_asked_for_waits_for_alter_and_happens_once() {
    let mut bench = Puma::default().bench(Host::new(HostConfig::default()).unwrap()).unwrap();
    let incidents = |bench: &Bench<Host, MarkIii>| {
        let told = bench.told().iter();
        told.filter(|(_, told)| matches!(told, SimulatorReport::Device(PumaEvent::Incident(_)))).count()
    };
    bench.device_mut().incident(Incident::Finish);
    assert_eq!(incidents(&bench), 0);
    bench.run_for(2 * S);
    assert_eq!(incidents(&bench), 1);
    bench.device_mut().incident(Incident::Finish);
    bench.run_for(5 * S);
    assert_eq!(incidents(&bench), 2);
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
    let incidents = bench
        .told()
        .iter()
        .filter(|(_, told)| matches!(told, SimulatorReport::Device(PumaEvent::Incident(_))));
    assert_eq!(incidents.count(), 2);
    // A cycle is 28 ms; of 900 s the starts, the pauses and the interruption are missing.
    let done = bench.executed();
    assert!((31_800..32_143).contains(&done.len()), "{}", done.len());
    assert!(done.windows(2).all(|two| two[1].at - two[0].at >= 27 * MS));
}

fn bench(incidents: Vec<(Duration, Incident)>) -> Bench<Host, MarkIii> {
    Puma { incidents, ..Puma::default() }.bench(Host::new(HostConfig::default()).unwrap()).unwrap()
}

/// A predicate of a robot's events.
type Predicate = fn(&PumaEvent) -> bool;

/// Returns the times of the robot's events of this kind.
fn told(bench: &Bench<Host, MarkIii>, what: Predicate) -> Vec<Duration> {
    let told = bench.told().iter();
    told.filter(|(_, told)| matches!(told, SimulatorReport::Device(event) if what(event)))
        .map(|(at, _)| *at)
        .collect()
}

fn started(event: &PumaEvent) -> bool {
    matches!(event, PumaEvent::Started(_))
}

fn ended(event: &PumaEvent) -> bool {
    matches!(event, PumaEvent::Ended(..))
}

fn incident(event: &PumaEvent) -> bool {
    matches!(event, PumaEvent::Incident(_))
}

/// "Beginnt mit 1" (§3.2.2): 36 cycles are a segment of the program, in 16384 parts.
#[test]
fn the_messages_say_which_segment_is_followed_and_how_much_of_it_is_done() {
    let mut bench = bench(Vec::new());
    bench.run_for(5 * S);
    let motions = bench.take_events().filter_map(|event| match event {
        HostEvent::Motion(motion) => Some((motion.segment_status, motion.segment, motion.percent)),
        _ => None,
    });
    let motions: Vec<_> = motions.collect();
    assert!(motions.len() > 100, "{}", motions.len());
    for (motion, cycles) in motions.into_iter().zip(0u16..) {
        let status = if cycles == 0 { SegmentStatus::NoneYet } else { SegmentStatus::Normal };
        let done = u32::from(cycles % 36) * 16384 / 36;
        assert_eq!((motion.0, motion.1, u32::from(motion.2)), (status, 1 + cycles / 36, done));
    }
}

#[test]
fn what_is_to_happen_happens_when_it_is_due() {
    let status = SegmentStatus::NullingUnplanned;
    let second = Incident::Misread(ErrorCode::Checksum);
    // In the middle of a cycle, and what comes while ALTER is interrupted waits.
    let mut bench = bench(vec![
        (2 * S + 5 * MS, Incident::Status(status)),
        (3 * S, Incident::Interrupt(S)),
        (3 * S + 500 * MS, second),
    ]);
    bench.run_for(10 * S);
    let begun = told(&bench, started)[0];
    let at: Vec<Duration> = told(&bench, incident).into_iter().map(|at| at - begun).collect();
    let cycle = 28 * MS;
    assert_eq!(at[0], 2 * S + 5 * MS);
    assert!((3 * S..3 * S + cycle).contains(&at[1]), "{at:?}");
    assert!((at[1] + S..at[1] + S + 2 * cycle).contains(&at[2]), "{at:?}");
    let bad = told(&bench, |event| *event == PumaEvent::BadReply(ErrorCode::Checksum));
    assert!(bad.len() == 1 && bad[0] >= begun + at[2], "{bad:?}");
    let motions = bench.take_events().filter_map(|event| match event {
        HostEvent::Motion(motion) => Some(motion),
        _ => None,
    });
    let motions: Vec<_> = motions.collect();
    let interrupted = motions.iter().filter(|motion| motion.phase == MotionPhase::Interrupted).count();
    assert!((34..=38).contains(&interrupted), "a second of them: {interrupted}");
    assert_eq!(motions.last().unwrap().segment_status, status);
}

#[test]
fn the_program_starts_a_while_after_its_port_is_open_and_after_its_end() {
    let mut bench = bench(vec![(2 * S, Incident::Finish), (2 * S + 500 * MS, Incident::Corrupt)]);
    assert!(bench.run_until(5 * S, |bench| !told(bench, started).is_empty()));
    let first = bench.now();
    assert!((200 * MS..250 * MS).contains(&first), "{first:?}");
    assert!(bench.run_until(5 * S, |bench| !told(bench, ended).is_empty()));
    let end = bench.now();
    assert!((first + 2 * S..first + 2 * S + 100 * MS).contains(&end), "{end:?}");
    // The next incident is due now, and waits: no time is asked for but that of the start.
    let overdue = first + 2 * S + 500 * MS;
    assert!(bench.run_until(S, |bench| bench.now() >= overdue));
    assert_eq!((bench.now(), bench.device().due()), (overdue, Some(end + S)));
    assert!(bench.run_until(5 * S, |bench| told(bench, started).len() == 2));
    assert!((end + S..end + S + 50 * MS).contains(&bench.now()), "{:?}", bench.now());
    // The port is gone, and ALTER with it.
    bench.run_for(S);
    bench.disconnect();
    bench.run_for(Duration::ZERO);
    assert_eq!(told(&bench, ended).last(), Some(&bench.now()));
    let gone = bench.now();
    assert!(bench.run_until(5 * S, |bench| told(bench, started).len() == 3));
    assert!((gone + S..gone + S + 50 * MS).contains(&bench.now()), "{:?}", bench.now());
}

/// An incident that is due before ALTER has begun again waits until then.
#[test]
fn each_program_is_finished() {
    let mut bench = bench(vec![(2 * S, Incident::Finish), (2 * S, Incident::Finish)]);
    bench.run_for(20 * S);
    assert_eq!([started, ended, incident].map(|what| told(&bench, what).len()), [3, 2, 2]);
}

/// In World the place is shifted, and not turned about the origin of the world.
#[test]
fn a_correction_is_given_in_the_worlds_frame_or_in_the_tools() {
    // A quarter of a turn about Z.
    let turned = Pose { n: [0.0, 1.0, 0.0], o: [-1.0, 0.0, 0.0], ..Pose::IDENTITY };
    let at = |p, turn| Pose { p, ..turn };
    let (path, correction) = ([10.0, 20.0, 30.0], [1.0, 2.0, 3.0]);
    let sum = at([11.0, 22.0, 33.0], turned);
    let cases = [
        (Pose::IDENTITY, turned, CoordinateFrame::World, sum),
        (Pose::IDENTITY, turned, CoordinateFrame::Tool, sum),
        (turned, Pose::IDENTITY, CoordinateFrame::World, sum),
        (turned, Pose::IDENTITY, CoordinateFrame::Tool, at([8.0, 21.0, 33.0], turned)),
    ];
    for (of_path, of_correction, frame, expected) in cases {
        assert_eq!(at(path, of_path).corrected(&at(correction, of_correction), frame), expected);
    }
}

/// The operator starts the program again a second after each.
#[test]
fn an_alter_that_the_host_refuses_or_does_not_answer_is_told_and_tried_again() {
    let cases: [(_, Predicate); 2] = [
        (Policy::Refuse, |event| *event == PumaEvent::Refused),
        (Policy::Ignore, |event| *event == PumaEvent::GaveUp),
    ];
    for (policy, outcome) in cases {
        let mut bench = bench(Vec::new());
        bench.session_mut().set_policy(Duration::ZERO, policy);
        bench.run_for(60 * S);
        let at = told(&bench, outcome);
        assert!(at.len() > 3 && at.windows(2).all(|two| two[1] - two[0] > S), "{policy:?}: {at:?}");
        assert_eq!(told(&bench, started), [Duration::ZERO; 0]);
    }
}

/// Returns a robot whose host has sent this exception after 2 s of ALTER.
fn excepted(subroutine: bool, exception: Exception) -> Bench<Host, MarkIii> {
    let mut puma = Puma::default();
    puma.config.subroutine = subroutine;
    let mut bench = puma.bench(Host::new(HostConfig::default()).unwrap()).unwrap();
    bench.session_mut().set_subroutine(Duration::ZERO, true);
    bench.run_for(2 * S);
    let now = bench.now();
    bench.session_mut().exception(now, exception).unwrap();
    bench.run_for(S);
    bench
}

#[test]
fn the_subroutine_moves_the_gripper_and_returns_in_its_time() {
    let events: [(_, Predicate); 3] = [
        (Exception::CloseGripper, |event| *event == PumaEvent::Gripper(true)),
        (Exception::OpenGripper, |event| *event == PumaEvent::Gripper(false)),
        (Exception::Other(9), |event| *event == PumaEvent::Exception(Exception::Other(9))),
    ];
    for (exception, told_as) in events {
        let mut bench = excepted(true, exception);
        assert_eq!((told(&bench, told_as).len(), told(&bench, ended).len()), (1, 0), "{exception:?}");
        let interrupted = bench.take_events().filter(
            |event| matches!(event, HostEvent::Motion(motion) if motion.phase == MotionPhase::Interrupted),
        );
        let interrupted = interrupted.count();
        assert!((4..=5).contains(&interrupted), "120 ms in cycles of 28 ms: {interrupted}");
    }
}

#[test]
fn an_exception_without_a_subroutine_ends_the_program() {
    let bench = excepted(false, Exception::CloseGripper);
    let told_as = |event: &PumaEvent| *event == PumaEvent::Exception(Exception::CloseGripper);
    assert_eq!([told(&bench, told_as).len(), told(&bench, ended).len()], [1, 1]);
}

/// The arm stands where it stood, and what has happened does not happen again.
#[test]
fn a_robot_that_was_without_power_goes_on_where_it_was() {
    let incidents = vec![
        (2 * S, Incident::Status(SegmentStatus::NullingUnplanned)),
        (4 * S, Incident::Status(SegmentStatus::Normal)),
        (9 * S, Incident::Status(SegmentStatus::NullingUnplanned)),
    ];
    let mut bench = bench(incidents);
    assert!(bench.run_until(5 * S, |bench| !told(bench, started).is_empty()));
    let begun = bench.now();
    while bench.now() < begun + 3 * S {
        let now = bench.now();
        bench.session_mut().set_target(now, [8, 0, 0, 0, 0, 0]);
        bench.run_for(50 * MS);
    }
    let now = bench.now();
    bench.session_mut().clear_target(now);
    bench.run_for(200 * MS);
    let (pose, counted) = (bench.device().pose(), bench.device().controller().statistics());
    assert!(pose.p[0] > 405.0, "{pose:?}");
    assert_ne!(counted, ControllerStatistics::default());
    assert_eq!(bench.device().session().statistics(), counted);
    bench.faults().restart(2 * S);
    bench.run_for(100 * MS);
    assert_eq!(bench.device().session().statistics(), ControllerStatistics::default());
    bench.run_for(15 * S);
    assert_eq!(bench.device().pose(), pose);
    let at: Vec<Duration> = told(&bench, incident).into_iter().map(|at| at - begun).collect();
    assert!(at.len() == 3 && at[0] == 2 * S && at[1] > 5 * S && at[2] == 9 * S, "{at:?}");
    assert_eq!(told(&bench, started).len(), 2);
}

/// Only ALTER can be disturbed: an overdue incident meanwhile needs no time, even right after a restart.
#[test]
fn what_is_overdue_asks_for_no_time_after_a_restart() {
    let mut bench = bench(vec![(2 * S, Incident::Finish), (2 * S + 500 * MS, Incident::Corrupt)]);
    assert!(bench.run_until(5 * S, |bench| !told(bench, ended).is_empty()));
    bench.run_for(900 * MS);
    let now = bench.now();
    bench.device_mut().restart(now);
    assert_eq!(bench.device().due(), None);
}

#[test]
fn a_layout_has_its_words_in_the_order_that_its_name_says() {
    let pose = Pose { n: [1.0, 2.0, 3.0], o: [4.0, 5.0, 6.0], a: [7.0, 8.0, 9.0], p: [10.0, 11.0, 12.0] };
    let words = Layout::NAMED
        .map(|(name, layout)| (name, Layout { rotation_one: 1.0, per_mm: 1.0, ..layout }.words(&pose).0));
    assert_eq!(
        words,
        [
            ("columns n o a p", [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]),
            ("rows of [n o a p]", [1, 4, 7, 10, 2, 5, 8, 11, 3, 6, 9, 12]),
            ("p, then columns n o a", [10, 11, 12, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
            ("rows of [n o a], then p", [1, 4, 7, 2, 5, 8, 3, 6, 9, 10, 11, 12]),
        ]
    );
}
