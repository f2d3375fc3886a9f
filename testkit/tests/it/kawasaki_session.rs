//! Both ends over a link on a virtual clock: whatever the transport commits, every job is executed once.
#![allow(clippy::cast_possible_truncation)]

use core::num::NonZeroU16;
use core::time::Duration;

use crate::kawasaki_rig::{JobSupplier, MS, Rig, expected, line, picture};
use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{Acks, Limits, PcConfig, PcEvent, RobotConfig, RobotEvent, Supply};
use testkit::controller::{AsRobot, Controller, Native};
use testkit::link::Faults;

const LIMIT: Duration = Duration::from_secs(300);

/// Creates both ends with the defaults.
fn any<C: Controller>(seed: u64, faults: Faults, capacity: usize, max_number: u16) -> Rig<C> {
    Rig::of(seed, faults, capacity, max_number, RobotConfig::tcp(), PcConfig::tcp())
}

/// Runs an order to its end, and checks the reports of both ends about it.
fn run<C: Controller>(rig: &mut Rig<C>, order: u16, jobs: u32, seed: u64) {
    rig.pc.start(order, picture(order, jobs)).unwrap();
    rig.run_until(LIMIT, Rig::is_over);
    assert_eq!(rig.lines(), expected(order, jobs), "seed {seed}");
    let over = PcEvent::OrderOver { order, executed: jobs, complete: true };
    assert!(rig.pc_events.contains(&over), "seed {seed}: {:?}", rig.pc_events);
    let progress = rig.pc_events.iter().filter_map(|event| match event {
        PcEvent::Progress { executed, queued } => Some((*executed, *queued)),
        _ => None,
    });
    let progress: Vec<_> = progress.collect();
    assert!(progress.is_sorted_by_key(|(executed, _)| *executed), "seed {seed}: {progress:?}");
    assert!(progress.iter().all(|(executed, queued)| executed <= queued), "seed {seed}: {progress:?}");
    assert!(
        jobs == 0 || progress.last() == Some(&(jobs, jobs)) || rig.pc.executed() == jobs,
        "seed {seed}: {progress:?}"
    );
}

#[test]
fn a_picture_of_5000_lines_is_drawn() {
    let mut rig = Rig::new(1, Faults::NONE, 256, 9999);
    run(&mut rig, 50, 5000, 1);
    assert_eq!(rig.robot.statistics().queued, 5000);
    assert_eq!(rig.robot.statistics().executed, 5000);
    // As many messages a packet as fit: 5000 jobs of some 38 bytes, and few packets more for the acknowledgements.
    assert!(rig.from_pc.len() < 300, "{}", rig.from_pc.len());
    assert!(rig.from_pc.iter().any(|packet| packet.len() > 4096 - 45));
    let odd = |event: &RobotEvent| matches!(event, RobotEvent::Corrupt(_) | RobotEvent::Recovery { .. });
    assert!(!rig.robot_events.iter().any(odd), "{:?}", rig.robot_events);
}

#[test]
fn numbers_wrap_while_the_order_goes_on() {
    numbers_wrap::<Native>();
    numbers_wrap::<AsRobot>();
}

fn numbers_wrap<C: Controller>() {
    for (capacity, max) in [(1, 2), (2, 3), (3, 5), (64, 65), (64, 1000)] {
        let mut rig = any::<C>(1, Faults::NONE, capacity, max);
        rig.motion = Some(Duration::from_micros(100));
        run(&mut rig, 1, 1200, u64::from(max));
    }
}

#[test]
fn whatever_tcp_commits_every_job_is_executed_once() {
    whatever_tcp_commits::<Native>(1500);
    whatever_tcp_commits::<AsRobot>(150);
}

fn whatever_tcp_commits<C: Controller>(seeds: u64) {
    for seed in 0..seeds {
        let (capacity, max) = [(1, 2), (3, 5), (10, 17), (64, 200), (64, 9999)][seed as usize % 5];
        let mut rig = any::<C>(seed, Faults { disconnect: 0.04, ..Faults::TCP }, capacity, max);
        rig.motion = Some([MS / 10, MS, 7 * MS][seed as usize % 3]);
        run(&mut rig, 7, 10 + seed as u32 % 70, seed);
    }
}

#[test]
fn so_it_is_when_jobs_overtake_one_another() {
    let robot = RobotConfig { acks: Acks::Individual, ..RobotConfig::tcp() };
    let mut some_ahead = 0;
    for seed in 0..600 {
        let (capacity, max) = [(3, 5), (10, 17), (64, 9999)][seed as usize % 3];
        let pc = PcConfig { cumulative_acks: false, max_number: max, ..PcConfig::tcp() };
        let faults = Faults { disconnect: 0.05, ..Faults::TCP };
        let mut rig = Rig::with(seed, faults, capacity, max, robot, pc);
        rig.overtakes = true;
        rig.motion = Some([MS, 7 * MS][seed as usize % 2]);
        let jobs = 20 + seed as u32 % 60;
        rig.pc.start(3, picture(3, jobs)).unwrap();
        rig.run_until(LIMIT, Rig::is_over);
        let place = |line: &kawasaki_msg::Line| (line.start.x, line.start.y);
        let (mut drawn, mut wanted) = (rig.lines(), expected(3, jobs));
        let in_order = drawn == wanted;
        drawn.sort_by_key(place);
        wanted.sort_by_key(place);
        assert_eq!(drawn, wanted, "seed {seed}");
        let over = PcEvent::OrderOver { order: 3, executed: jobs, complete: true };
        assert!(rig.pc_events.contains(&over), "seed {seed}: {:?}", rig.pc_events);
        // Each job that was executed ahead is reported as such at most once.
        let mut ahead: Vec<u32> = rig
            .pc_events
            .iter()
            .filter_map(|e| if let PcEvent::ExecutedAhead { index } = e { Some(*index) } else { None })
            .collect();
        some_ahead += usize::from(!in_order && !ahead.is_empty());
        let reported = ahead.len();
        ahead.sort_unstable();
        ahead.dedup();
        assert_eq!(ahead.len(), reported, "seed {seed}");
    }
    assert!(some_ahead > 100, "{some_ahead}");
}

#[test]
fn so_it_is_when_the_list_is_cleared_again_and_again() {
    the_list_is_cleared_again_and_again::<Native>(300);
    the_list_is_cleared_again_and_again::<AsRobot>(100);
}

fn the_list_is_cleared_again_and_again<C: Controller>(seeds: u64) {
    for seed in 0..seeds {
        let individual = seed % 2 == 0 && C::WHOLE;
        let acks = if individual { Acks::Individual } else { RobotConfig::tcp().acks };
        let robot = RobotConfig { acks, ..RobotConfig::tcp() };
        let pc = PcConfig { cumulative_acks: !individual, max_number: 50, ..PcConfig::tcp() };
        let mut rig = Rig::<C>::of(seed, Faults { disconnect: 0.02, ..Faults::TCP }, 16, 50, robot, pc);
        rig.overtakes = individual;
        rig.motion = Some(5 * MS);
        let jobs = 60;
        rig.pc.start(3, picture(3, jobs)).unwrap();
        let mut clears = 0;
        while !rig.is_over() {
            assert!(rig.now < LIMIT, "seed {seed}: {}", rig.summary());
            let before = rig.executed.len();
            rig.step();
            if rig.executed.len() > before && before % 7 == 3 && rig.robot.clear_queue().is_ok() {
                clears += 1;
            }
        }
        let mut drawn: Vec<_> = rig.lines();
        drawn.sort_by_key(|line| line.start.x);
        assert_eq!(drawn, expected(3, jobs), "seed {seed}");
        assert!(clears > 3, "seed {seed}");
    }
}

#[test]
fn so_it_is_with_every_kth_acknowledgement() {
    every_kth_acknowledgement::<Native>(300);
    every_kth_acknowledgement::<AsRobot>(60);
}

fn every_kth_acknowledgement<C: Controller>(seeds: u64) {
    for seed in 0..seeds {
        let every = NonZeroU16::new([2, 3, 10, 100][seed as usize % 4]).unwrap();
        let robot = RobotConfig { acks: Acks::Cumulative { every }, ..RobotConfig::tcp() };
        let pc = PcConfig { max_number: 40, ..PcConfig::tcp() };
        let mut rig = Rig::<C>::of(seed, Faults { disconnect: 0.03, ..Faults::TCP }, 16, 40, robot, pc);
        run(&mut rig, 7, 90, seed);
    }
}

#[test]
fn so_it_is_over_udp() {
    for seed in 0..300 {
        let pc = PcConfig { max_number: 1000, ..PcConfig::udp() };
        let mut rig = Rig::with(seed, Faults::UDP, 64, 1000, RobotConfig::udp(), pc);
        run(&mut rig, 7, 100, seed);
        let packets = rig.from_pc.iter().chain(&rig.from_robot);
        assert!(packets.map(Vec::len).max() <= Some(Limits::UDP.packet));
    }
}

#[test]
fn several_orders_follow_one_another() {
    several_orders::<Native>(100);
    several_orders::<AsRobot>(50);
}

fn several_orders<C: Controller>(seeds: u64) {
    for seed in 0..seeds {
        let mut rig = any::<C>(seed, Faults { disconnect: 0.03, ..Faults::TCP }, 8, 9999);
        let mut wanted = Vec::new();
        for order in 1..=4 {
            rig.pc_events.clear();
            rig.pc.start(order, picture(order, 15)).unwrap();
            rig.run_until(LIMIT, Rig::is_over);
            wanted.extend(expected(order, 15));
            assert_eq!(rig.lines(), wanted, "seed {seed}, order {order}");
        }
    }
}

/// No job is executed twice, no job is left out, and the PC's final report is true, whatever happens in between
/// (interruptions, resets, restarts of either end).
#[test]
fn what_the_pc_says_is_true_when_anything_can_happen() {
    anything_can_happen::<Native>(1000);
    anything_can_happen::<AsRobot>(400);
}

fn anything_can_happen<C: Controller>(seeds: u64) {
    let (mut unknown, mut interrupted, mut complete) = (0, 0, 0);
    for seed in 0..seeds {
        let mut rng = robot_session::contract::Rng::new(seed);
        let mut rig = any::<C>(seed, Faults { disconnect: 0.02, ..Faults::TCP }, 16, 100);
        rig.motion = Some(3 * MS);
        let jobs = 40 + rng.below(40) as u32;
        rig.pc.start(9, picture(9, jobs)).unwrap();
        let at = Duration::from_millis(rng.below(800) as u64);
        rig.run_until(LIMIT, |rig| rig.now >= at || rig.is_over());
        match rng.below(4) {
            0 => _ = rig.pc.interrupt(),
            1 => _ = rig.robot.reset_order(),
            2 => crate::kawasaki_rig::restart(&mut rig, 16, 100),
            _ => rig.link.disconnect(rig.now),
        }
        rig.run_until(LIMIT, |rig| rig.is_over() || rig.pc.order().is_none());
        rig.pc_pass();
        let executed = rig.executed.len() as u32;
        assert_eq!(rig.lines(), expected(9, executed), "seed {seed}: in order, none twice");
        let said = rig.pc_events.iter().rev().find_map(|event| match *event {
            PcEvent::OrderOver { executed, complete, .. } => Some((executed, executed, complete)),
            PcEvent::OutcomeUnknown { executed, sent, .. } => Some((executed, sent, false)),
            _ => None,
        });
        let (least, most, all) = said.unwrap_or_else(|| panic!("seed {seed}: {}", rig.summary()));
        assert!((least..=most).contains(&executed), "seed {seed}: {executed} of {least}..={most}");
        assert_eq!(all, executed == jobs && least == most, "seed {seed}");
        unknown += u64::from(least != most);
        complete += u64::from(all);
        interrupted += u64::from(!all && least == most);
    }
    let least = seeds / 20;
    assert!(
        [unknown, interrupted, complete].iter().all(|count| *count > least),
        "{unknown} {interrupted} {complete}"
    );
}

#[test]
fn a_source_that_is_late_and_a_robot_that_is_slow_lose_nothing() {
    a_late_source_and_a_slow_robot::<Native>();
    a_late_source_and_a_slow_robot::<AsRobot>();
}

fn a_late_source_and_a_slow_robot<C: Controller>() {
    for seed in 0..50 {
        let mut rig = any::<C>(seed, Faults { disconnect: 0.03, ..Faults::TCP }, 8, 20);
        let mut asked = 0;
        let source: JobSupplier = Box::new(move |index| {
            asked += 1;
            match index {
                30.. => Supply::End,
                _ if asked % 3 == 0 => Supply::Later,
                _ => Supply::Job(line(2, index)),
            }
        });
        rig.motion = Some(50 * MS);
        rig.pc.start(2, source).unwrap();
        rig.run_until(LIMIT, Rig::is_over);
        assert_eq!(rig.lines(), expected(2, 30), "seed {seed}");
    }
}
