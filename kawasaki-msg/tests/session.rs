//! Both ends over a link on a virtual clock.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation
)]

mod common;

use common::{MS, Rig, line, picture};
use core::time::Duration;
use kawasaki_msg::{PcEvent, RobotEvent};
use testkit::link::Faults;

fn expected(order: u16, jobs: u32) -> Vec<kawasaki_msg::Line> {
    (0..jobs).map(|index| line(order, index)).collect()
}

#[test]
fn an_order_is_drawn_once_and_ends() {
    let mut rig = Rig::new(1, Faults::NONE, 64, 9999);
    rig.pc.start(50, picture(50, 2000)).unwrap();
    rig.run_until(Duration::from_secs(100), Rig::is_over);
    assert_eq!(rig.lines(), expected(50, 2000));
    assert!(
        rig.pc_events.contains(&PcEvent::OrderOver { order: 50, executed: 2000, complete: true }),
        "{:?}",
        rig.pc_events
    );
    assert!(
        rig.robot_events.contains(&RobotEvent::OrderOver { order: 50, executed: 2000 }),
        "{:?}",
        rig.robot_events
    );
    for (r, p) in rig.from_robot.iter().zip(&rig.from_pc).take(20) {
        println!("R {}\nP {}", r.escape_ascii(), p[..p.len().min(150)].escape_ascii());
    }
    println!("{:?}", rig.now);
}

#[test]
fn whatever_tcp_commits_every_job_is_executed_once() {
    for seed in 0..300 {
        let (capacity, max) = [(1, 2), (3, 5), (10, 17), (64, 200), (64, 9999)][seed as usize % 5];
        let faults = Faults { disconnect: 0.05, ..Faults::TCP };
        let mut rig = Rig::new(seed, faults, capacity, max);
        let jobs = 20 + seed as u32 % 150;
        rig.pc.start(7, picture(7, jobs)).unwrap();
        rig.run_until(Duration::from_secs(2000), Rig::is_over);
        assert_eq!(rig.lines(), expected(7, jobs), "seed {seed}");
        let over = PcEvent::OrderOver { order: 7, executed: jobs, complete: true };
        assert!(rig.pc_events.contains(&over), "seed {seed}: {:?}", rig.pc_events);
    }
    let _ = MS;
}
