//! The session records every job that the motion task completes, whatever happens in between.

use core::cell::RefCell;
use core::fmt::Write as _;
use core::num::NonZeroU16;
use core::time::Duration;
use std::rc::Rc;

use kawasaki_msg::motion::{JobQueue, Motion, boxed, boxed_with};
use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::robot_session::end::End as _;
use kawasaki_msg::robot_work_queue::{NoWake, Wake};
use kawasaki_msg::{Acks, Line, Robot, RobotConfig, RobotEvent};

const MS: Duration = Duration::from_millis(1);

/// Starts order 50 at the robot, and sends it these jobs in one packet.
fn give<R: Wake>(robot: &mut Robot<'_, Line, 256, R>, jobs: u16) {
    robot.handle_timeout(MS);
    robot.handle_connected(MS);
    cycle(robot, 2 * MS);
    let mut packet = String::from("<TilausAlkaa$4#50$1#>");
    for number in 1..=jobs {
        let data = format!("50${number}$1$0$0$1$1");
        write!(packet, "<Tyo${}#{data}#>", data.len()).unwrap();
    }
    robot.handle_input(3 * MS, packet.as_bytes());
}

fn cycle<R: Wake>(robot: &mut Robot<'_, Line, 256, R>, now: Duration) {
    robot.handle_timeout(now);
    robot.poll_transmit(now, &mut [0; 4096]).expect("it speaks first");
}

fn events<R: Wake>(robot: &mut Robot<'_, Line, 256, R>) -> Vec<RobotEvent> {
    core::iter::from_fn(|| robot.poll_event()).collect()
}

/// The session was not called in between: neither a turn nor a timeout.
#[test]
fn what_was_executed_before_a_reset_is_executed() {
    let (jobs, mut motion) = boxed(64, 9999).unwrap();
    let mut robot = Robot::new(RobotConfig::tcp(), jobs).unwrap();
    give(&mut robot, 30);
    assert_eq!(robot.queued(), 30);
    for _ in 0..25 {
        motion.take().unwrap().complete();
    }
    robot.reset_order().unwrap();
    assert!(motion.take().is_none(), "five were discarded");
    // Twice: an order is over a control cycle after its queue has settled.
    robot.handle_timeout(5 * MS);
    robot.handle_timeout(50 * MS);
    let over = RobotEvent::OrderOver { order: 50, executed: 25 };
    assert!(events(&mut robot).contains(&over), "{:?}", robot.machine());
}

/// A motion task that is as fast as the session, and a queue of one: each job is executed before the next one is queued.
#[test]
fn no_report_waits_for_a_place() {
    let end: Rc<RefCell<Option<Motion<'_, Line>>>> = Rc::default();
    let of_hook = Rc::clone(&end);
    let execute = move || {
        // The hook of a queue that is being made has no end yet.
        let mut end = of_hook.borrow_mut();
        let Some(motion) = end.as_mut() else { return };
        while let Some(job) = motion.take() {
            job.complete();
        }
    };
    let (jobs, motion) = boxed_with(1, 9999, execute, NoWake).unwrap();
    end.replace(Some(motion));
    let mut robot = Robot::new(RobotConfig::tcp(), jobs).unwrap();
    give(&mut robot, 100);
    robot.handle_timeout(4 * MS);
    assert_eq!((robot.queued(), robot.executed()), (100, 100));
}

#[test]
fn a_job_that_overtakes_is_reported_where_none_may() {
    for (acks, executed) in [(Acks::Cumulative { every: NonZeroU16::MIN }, 0), (Acks::Individual, 3)] {
        let (jobs, mut motion) = boxed(64, 999).unwrap();
        let config = RobotConfig { acks, max_number: 999, ..RobotConfig::tcp() };
        let mut robot = Robot::new(config, jobs).unwrap();
        give(&mut robot, 3);
        events(&mut robot);
        let last = motion.take_where(|job| job.number == 3).unwrap().complete();
        assert_eq!((last.order, last.number), (50, 3));
        robot.handle_timeout(4 * MS);
        let unexpected = events(&mut robot).iter().any(|it| matches!(it, RobotEvent::Unexpected(_)));
        assert_eq!(unexpected, executed == 0);
        if executed > 0 {
            assert_eq!(motion.iter().map(|job| job.number).collect::<Vec<_>>(), [1, 2]);
            assert_eq!((motion.len(), motion.is_empty(), motion.capacity()), (2, false, 64));
            while let Some(job) = motion.take() {
                job.complete();
            }
            assert!(motion.is_empty());
            robot.handle_timeout(5 * MS);
            assert_eq!(robot.executed(), executed);
        }
    }
}

#[test]
fn a_job_that_is_not_completed_waits_again() {
    let (jobs, mut motion) = boxed(4, 9999).unwrap();
    let mut robot = Robot::<Line>::new(RobotConfig::tcp(), jobs).unwrap();
    give(&mut robot, 2);
    drop(motion.take().unwrap());
    robot.handle_timeout(4 * MS);
    assert_eq!((robot.executed(), motion.take().unwrap().complete().number), (0, 1));
    assert!(!motion.is_abandoned() && !robot.is_abandoned());
    drop(robot);
    assert!(motion.is_abandoned());
    assert_eq!(motion.take().map(|job| job.complete().number), Some(2));
}

#[test]
fn a_queue_in_a_static_has_two_ends_until_they_are_dropped() {
    static QUEUE: JobQueue<Line, 4> = JobQueue::numbered::<9999>();
    for _ in 0..2 {
        let (jobs, mut motion) = QUEUE.split_static(NoWake, NoWake).expect("it has no ends");
        assert!(QUEUE.split_static(NoWake, NoWake).is_none());
        let mut robot = Robot::<Line>::new(RobotConfig::tcp(), jobs).unwrap();
        give(&mut robot, 2);
        assert_eq!(motion.take().map(|job| job.complete().number), Some(1));
    }
}
