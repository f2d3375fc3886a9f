//! A Kawasaki robot that misbehaves, over TCP and for half an hour on a virtual clock.

use core::time::Duration;

use cellwire_sim::kawasaki::{Kawasaki, Pc};
use cellwire_sim::{
    Bench, Device as _, Fault, KawasakiPc, KawasakiRobot, Script, Settings as _, Simulator, SimulatorReport,
};
use kawasaki_msg::robot_session::tokio::{Listen, Tcp};
use kawasaki_msg::tokio::{Error, pc, robot};
use kawasaki_msg::{
    JobKind, LargePc, Line, PcConfig, PcEvent, Point, RobotConfig, RobotEvent, Takeover, Work,
};

const MS: Duration = Duration::from_millis(1);
const S: Duration = Duration::from_secs(1);

fn jobs(count: i32) -> Vec<Line> {
    let jobs = 0..count;
    jobs.map(|n| Line { kind: JobKind::Draw, start: Point::new(n, 0), end: Point::new(n + 1, 0) }).collect()
}

#[tokio::test]
async fn an_order_over_cuts_and_lost_packets_is_drawn_once() {
    let listen = Listen::bind("127.0.0.1:0").await.unwrap();
    let robot = KawasakiRobot::<Line> { job_time: MS, ..KawasakiRobot::default() };
    let sim = robot.connect(listen.address().unwrap()).unwrap();
    sim.faults()
        .follow(Script::new().answer(2, Fault::Cut).request(4, Fault::Drop).answer(6, Fault::Corrupt));
    let (pc, task) = pc(PcConfig::tcp(), (), listen).unwrap();
    tokio::spawn(task.run());
    pc.run(50, jobs(600)).await.unwrap();
    let drawn: Vec<Line> = sim.executed().into_iter().map(|done| done.work.work).collect();
    assert_eq!(drawn, jobs(600));
    assert_eq!(sim.faults().happened().len(), 3);
}

#[tokio::test]
async fn a_robot_that_has_forgotten_its_order_is_noticed() {
    let listen = Listen::bind("127.0.0.1:0").await.unwrap();
    let robot = KawasakiRobot::<Line> { job_time: MS, ..KawasakiRobot::default() };
    let sim = robot.connect(listen.address().unwrap()).unwrap();
    let (pc, task) = pc(PcConfig::tcp(), (), listen).unwrap();
    tokio::spawn(task.run());
    let order = pc.start(50, jobs(5000)).await.unwrap();
    while sim.executed().len() < 10 {
        tokio::time::sleep(MS).await;
    }
    sim.faults().restart(50 * MS);
    let over = order.await;
    assert!(!matches!(&over, Ok(over) if over.executed == 5000), "{over:?}");
    assert!(sim.executed().len() < 5000 && !matches!(over, Err(Error::Closed(_))));
}

/// Half an hour of drawing over a connection that is cut at every thousandth packet.
#[test]
fn half_an_hour_of_drawing() {
    let robot = KawasakiRobot::<Line> { job_time: 3 * S, ..KawasakiRobot::default() };
    let jobs = jobs(600);
    let mut pc: LargePc<&[Line]> = LargePc::with_ranges(PcConfig::tcp(), Default::default()).unwrap();
    pc.start(7, jobs.leak()).unwrap();
    let mut bench = robot.bench(pc).unwrap();
    bench.faults().follow(Script::new().every_answer(1000, Fault::Cut));
    bench.run_for(S);
    assert!(bench.device().held() > 1, "{}", bench.device().held());
    let over = loop {
        match bench.next_event(3600 * S) {
            Some(PcEvent::Disconnect) => bench.disconnect(),
            Some(PcEvent::OrderOver { executed, .. }) => break executed,
            Some(PcEvent::OutcomeUnknown { .. }) | None => panic!("{:?}", bench.told().last()),
            Some(_) => {}
        }
    };
    let done = bench.executed();
    assert_eq!((over, done.len()), (600, 600));
    assert!(
        done.windows(2).all(|two| two[0].at < two[1].at && two[0].work.work.end == two[1].work.work.start)
    );
    assert!((1800 * S..2000 * S).contains(&done[599].at), "{:?}", done[599].at);
    let connections = bench
        .told()
        .iter()
        .filter(|(_, told)| matches!(told, SimulatorReport::Device(RobotEvent::Connect)))
        .count();
    assert!(connections > 3, "{connections}");
}

/// A robot's handle against a PC that loses its connection in the middle of packets, and begins one order after the other.
#[tokio::test]
async fn a_robot_draws_each_order_of_a_pc_once() {
    let pc = KawasakiPc { jobs: jobs(300).into(), order: 65_535, repeat: true, ..KawasakiPc::default() };
    let sim = pc.listen("127.0.0.1:0").unwrap();
    sim.faults()
        .follow(Script::new().answer(3, Fault::Cut).answer(9, Fault::Drop).request(12, Fault::Corrupt));
    let to = Tcp::new(sim.address().to_string());
    let ranges = <Line as Work>::Ranges::default();
    let (_robot, mut motion, task) = robot::<Line, _>(RobotConfig::tcp(), ranges, 64, to).unwrap();
    tokio::spawn(task.run());
    let mut drawn = Vec::new();
    let mut draw = async |orders: usize| {
        while sim.executed().len() < orders {
            // The PC reports its progress only to the test.
            let _ = tokio::time::timeout(MS, motion.wait()).await;
            while let Some(job) = motion.take() {
                drawn.push(job.work);
                job.complete();
            }
        }
    };
    draw(2).await;
    sim.faults().forget();
    draw(3).await;
    assert_eq!(drawn[..600], [jobs(300), jobs(300)].concat());
    assert_eq!(sim.faults().happened().len(), 4);
    let over = sim.executed().into_iter().map(|over| over.work);
    let over: Vec<_> = over
        .map(|over| match over {
            PcEvent::OrderOver { order, executed, complete } => (order, executed, complete),
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(over[..2], [(65_535, 300, true), (1, 300, true)]);
    assert!(matches!(over[2], (2, 0..300, false)), "{over:?}");
}

#[test]
fn a_job_is_over_when_it_is_due() {
    let robot = KawasakiRobot::<Line> { job_time: 3 * S, ..KawasakiRobot::default() };
    let mut pc: LargePc<&[Line]> = LargePc::with_ranges(PcConfig::tcp(), Default::default()).unwrap();
    pc.start(7, jobs(3).leak()).unwrap();
    let mut bench = robot.bench(pc).unwrap();
    assert_eq!(bench.device().due(), None);
    assert!(bench.run_until(S, |bench| bench.device().due().is_some()));
    let begun = bench.now();
    for number in 1..=3u32 {
        let before = bench.executed().len();
        assert!(bench.run_until(4 * S, |bench| bench.executed().len() > before));
        let end = begun + 3 * S * number;
        assert_eq!((bench.now(), bench.executed().last().unwrap().at), (end, end));
    }
    bench.run_for(S);
    assert_eq!((bench.device().held(), bench.device().due()), (0, None));
}

/// Without `repeat` one order is given to each connection; one that was refused for good, or is over, is not followed by another.
#[test]
fn a_pc_begins_an_order_when_a_robot_connects_and_when_it_is_to_repeat() {
    for (repeat, many) in [(false, false), (true, true)] {
        let pc = KawasakiPc { jobs: jobs(3).into(), repeat, ..KawasakiPc::default() };
        let robot = KawasakiRobot::<Line> { job_time: S, ..KawasakiRobot::default() };
        let mut bench = pc.bench(robot.simulator().unwrap()).unwrap();
        let orders = |bench: &cellwire_sim::Bench<_, cellwire_sim::kawasaki::Pc<Line>>| {
            let over = bench.executed().iter().filter_map(|done| match done.work {
                PcEvent::OrderOver { order, executed: 3, complete: true } => Some(order),
                _ => None,
            });
            over.collect::<Vec<u16>>()
        };
        bench.run_for(60 * S);
        assert_eq!(bench.device().due(), None);
        let over = orders(&bench);
        assert_eq!((over[0], over.len() > 5), (50, many), "{over:?}");
        if !repeat {
            assert_eq!(over, [50]);
            bench.disconnect();
            bench.run_for(60 * S);
            assert_eq!(orders(&bench), [50, 51]);
        }
    }
}

/// The order continues with the next connection, and is not given again.
#[test]
fn a_connection_that_is_lost_within_an_order_makes_no_other_one() {
    let pc = KawasakiPc { jobs: jobs(9).into(), ..KawasakiPc::default() };
    let robot = KawasakiRobot::<Line> { job_time: S, ..KawasakiRobot::default() };
    let mut bench = pc.bench(robot.simulator().unwrap()).unwrap();
    for lost in [3, 4] {
        bench.run_for(lost * S);
        assert!(bench.executed().is_empty());
        bench.disconnect();
    }
    bench.run_for(120 * S);
    let over: Vec<PcEvent> = bench.executed().iter().map(|done| done.work).collect();
    assert_eq!(over, [PcEvent::OrderOver { order: 50, executed: 9, complete: true }]);
}

#[test]
fn settings_of_a_robot_show_all_but_the_function() {
    let shown = format!("{:?}", KawasakiRobot::<Line>::default());
    let begins = format!("KawasakiRobot {{ config: {:?}, ranges: ", RobotConfig::tcp());
    assert!(shown.starts_with(&begins) && shown.ends_with(", queue: 256, job_time: 1s, .. }"), "{shown}");
}

#[test]
fn a_robot_ends_its_connection_to_a_pc_that_is_silent_and_makes_another() {
    let mut bench = KawasakiRobot::<Line>::default().bench(crate::gadget::Line::default()).unwrap();
    bench.run_for(60 * S);
    let silent =
        bench.told().iter().filter(|(_, told)| *told == SimulatorReport::Close("the PC is silent")).count();
    let connections = bench.session().log.iter().filter(|line| line.ends_with(" connected")).count();
    assert!(silent >= 2 && connections > silent - 1, "{:?}", bench.told());
}

#[test]
fn a_robot_that_forgets_its_order_executes_the_job_that_it_has_begun_and_no_more() {
    let robot = KawasakiRobot::<Line> { job_time: 3 * S, ..KawasakiRobot::default() };
    let mut pc: LargePc<&[Line]> = LargePc::with_ranges(PcConfig::tcp(), Default::default()).unwrap();
    pc.start(7, jobs(600).leak()).unwrap();
    let mut bench = robot.bench(pc).unwrap();
    assert!(bench.run_until(60 * S, |bench| bench.executed().len() == 5));
    bench.run_for(S);
    bench.faults().forget();
    bench.run_for(600 * S);
    let over = bench.take_events().find(|event| {
        matches!(event, PcEvent::OrderOver { complete: false, .. } | PcEvent::OutcomeUnknown { .. })
    });
    assert!(over.is_some());
    assert_eq!((bench.executed().len(), bench.device().held()), (6, 0));
}

type Two = Bench<Simulator<Kawasaki<Line>>, Pc<Line>>;

/// Returns a PC with orders of 20 jobs, and a robot that has executed three jobs of the first.
fn in_the_middle(config: PcConfig) -> Two {
    let pc = KawasakiPc { config, jobs: jobs(20).into(), ..KawasakiPc::default() };
    let robot = KawasakiRobot::<Line> { job_time: S, ..KawasakiRobot::default() };
    let mut bench = pc.bench(robot.simulator().unwrap()).unwrap();
    let executed = |bench: &mut Two| core::iter::from_fn(|| bench.session_mut().poll_executed()).count();
    let mut count = 0;
    assert!(bench.run_until(60 * S, |bench| {
        count += executed(bench);
        count == 3
    }));
    bench
}

fn over(bench: &Two) -> Vec<(u16, Option<bool>)> {
    let outcomes = bench.executed().iter().map(|done| match done.work {
        PcEvent::OrderOver { order, complete, .. } => (order, Some(complete)),
        PcEvent::OutcomeUnknown { order, .. } => (order, None),
        other => panic!("{other:?}"),
    });
    outcomes.collect()
}

#[test]
fn a_pc_follows_an_order_whose_outcome_is_unknown_by_the_next_one() {
    let mut bench = in_the_middle(PcConfig::tcp());
    let now = bench.now();
    bench.session_mut().device_mut().restart(now);
    bench.disconnect();
    bench.run_for(100 * S);
    assert_eq!(over(&bench)[..2], [(50, None), (51, Some(true))]);
}

/// The robot is at work on an order that the PC does not know any more, and refuses each other one.
#[test]
fn a_pc_that_was_without_power_begins_with_the_next_number_until_the_robot_takes_it() {
    let mut bench = in_the_middle(PcConfig { takeover: Takeover::Never, ..PcConfig::tcp() });
    let now = bench.now();
    bench.device_mut().restart(now);
    bench.disconnect();
    bench.run_for(10 * S);
    assert_eq!(over(&bench), []);
    let now = bench.now();
    bench.session_mut().device_mut().forget(now);
    bench.run_for(100 * S);
    let refused = bench.told().iter().filter_map(|(_, told)| match told {
        SimulatorReport::Device(PcEvent::OrderRefused { order, active: 50, given_up: true }) => Some(*order),
        _ => None,
    });
    let refused: Vec<u16> = refused.collect();
    assert!(refused.len() > 1 && (51..).zip(&refused).all(|(order, found)| order == *found), "{refused:?}");
    assert_eq!(over(&bench)[0], (refused.last().unwrap() + 1, Some(true)));
}
