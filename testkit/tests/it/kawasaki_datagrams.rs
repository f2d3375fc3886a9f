//! Over UDP a datagram may be lost, repeated and late: tests that orders tolerate it.

use core::time::Duration;

use crate::kawasaki_rig::{MS, Rig, expected, picture, sent};
use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{Acks, PcConfig, PcEvent, Robot, RobotConfig, RobotEvent};
use testkit::controller::{Controller as _, Native};
use testkit::link::Faults;

const LIMIT: Duration = Duration::from_secs(100);

fn rig(robot: RobotConfig, pc: PcConfig) -> Rig {
    Rig::with(1, Faults { datagrams: true, ..Faults::NONE }, 64, pc.max_number, robot, pc)
}

/// The start of an order arrives once more when the order is over, followed by its jobs.
#[test]
fn a_late_start_does_not_begin_an_order_again() {
    let mut rig = rig(RobotConfig::udp(), PcConfig::udp());
    for order in 1..=3 {
        rig.pc_events.clear();
        rig.pc.start(order, picture(order, 4)).unwrap();
        rig.run_until(LIMIT, Rig::is_over);
    }
    let drawn = rig.lines();
    assert_eq!(drawn, [expected(1, 4), expected(2, 4), expected(3, 4)].concat());
    let late: Vec<Vec<u8>> = rig.from_pc.clone();
    rig.robot_events.clear();
    for datagram in late {
        rig.robot.handle_input(rig.now, &datagram);
        rig.run_for(MS * 100);
    }
    assert_eq!(rig.lines(), drawn, "executed again");
    assert!(rig.robot_events.contains(&RobotEvent::OrderRefused { order: 1, active: 0 }));
    rig.pc_events.clear();
    rig.pc.start(4, picture(4, 2)).unwrap();
    rig.run_until(LIMIT, Rig::is_over);
    assert_eq!(rig.lines().len(), drawn.len() + 2, "a new order is taken");
    // Over TCP nothing is late, and the same picture may start again.
    let mut rig = Rig::new(1, Faults::NONE, 64, 9999);
    for _ in 0..2 {
        rig.pc_events.clear();
        rig.pc.start(1, picture(1, 4)).unwrap();
        rig.run_until(LIMIT, Rig::is_over);
    }
    assert_eq!(rig.lines(), [expected(1, 4), expected(1, 4)].concat());
}

/// A robot that has lost its memory cannot know which starts are old.
#[test]
fn a_robot_that_was_just_started_hears_no_start_for_a_second() {
    let mut rig = rig(RobotConfig::udp(), PcConfig::udp());
    rig.pc.start(7, picture(7, 2)).unwrap();
    rig.run_for(MS * 990);
    assert_eq!((rig.robot.order(), sent(&rig.from_robot, "TilausKuittaus").len()), (None, 0));
    assert!(sent(&rig.from_pc, "TilausAlkaa").len() > 10, "asked again in each cycle");
    rig.run_until(LIMIT, Rig::is_over);
    assert_eq!(rig.lines(), expected(7, 2));
    assert_eq!(sent(&rig.from_robot, "TilausKuittaus")[0], "<TilausKuittaus$1#7#>");
}

/// A start of before its restart came in time, and was read when a process that had been asleep woke up.
#[test]
fn what_waited_to_be_read_is_as_late_as_what_comes_late() {
    let mut rig = rig(RobotConfig::udp(), PcConfig::udp());
    rig.pc.start(3, picture(3, 4)).unwrap();
    rig.run_until(LIMIT, Rig::is_over);
    let starts = sent(&rig.from_pc, "TilausAlkaa");
    let mut robot = Native::begin(RobotConfig::udp(), 64, 1);
    robot.handle_connected(rig.now);
    let woken = rig.now + Duration::from_secs(3);
    for start in &starts {
        robot.handle_input(woken, start.as_bytes());
    }
    assert_eq!(robot.order(), None, "{} old starts", starts.len());
    // The PC repeats a new one with every answer.
    robot.handle_input(woken + RobotConfig::udp().exchange, starts[0].as_bytes());
    assert_eq!(robot.order(), Some(3));
}

/// An empty number of jobs executed would read as none.
#[test]
fn a_robot_that_was_just_started_does_not_acknowledge_the_end_of_an_order_that_it_does_not_know() {
    let mut rig = rig(RobotConfig::udp(), PcConfig::udp());
    rig.motion = Some(MS * 10);
    rig.pc.start(1, picture(1, 40)).unwrap();
    rig.run_until(LIMIT, |rig| rig.executed.len() == 5);
    rig.run_for(MS * 5);
    rig.robot = Native::begin(RobotConfig::udp(), 64, 1);
    rig.from_robot.clear();
    rig.pc.interrupt().unwrap();
    rig.run_until(LIMIT, Rig::is_over);
    assert_eq!(sent(&rig.from_robot, "LoppuKuittaus"), [""; 0]);
    let unknown = PcEvent::OutcomeUnknown { order: 1, executed: rig.pc.executed(), sent: 40 };
    assert!(rig.pc_events.contains(&unknown), "{:?}", rig.pc_events);
}

/// A late start may begin an old order before the end of the last one is reported: that reports the executed jobs of its own
/// order.
#[test]
fn the_end_of_an_order_is_told_with_its_own_jobs_when_another_has_begun() {
    let (writer, mut reader) = robot_work_queue::boxed(8, 99).unwrap();
    let mut robot = Robot::new(RobotConfig { max_number: 99, ..RobotConfig::udp() }, writer).unwrap();
    let (mut now, mut out) = (MS, [0; 1472]);
    robot.handle_timeout(now);
    robot.handle_connected(now);
    let mut say = |robot: &mut Robot<'_, kawasaki_msg::Line>, now, received: &[u8]| {
        robot.handle_timeout(now);
        let length = robot.poll_transmit(now, &mut out).unwrap();
        robot.handle_input(now + MS, received);
        String::from_utf8(out[..length].to_vec()).unwrap()
    };
    now += Duration::from_secs(2);
    // The first after the time in which a start may be late is not looked at.
    say(&mut robot, now - MS * 50, b"<TilausAlkaa$3#3$1#>");
    say(&mut robot, now, b"<TilausAlkaa$3#3$1#>");
    say(&mut robot, now + MS * 50, b"<Tyo$13#3$1$1$0$0$1$1#><Tyo$13#3$2$1$1$1$2$2#>");
    for number in [1, 2] {
        let job = reader.take().unwrap();
        robot.job_done(now, number).unwrap();
        job.complete();
    }
    say(&mut robot, now + MS * 100, b"");
    robot.reset_order().unwrap();
    for later in [101, 104] {
        robot.handle_timeout(now + MS * later);
        assert!(reader.take().is_none());
    }
    assert_eq!(robot.order(), None);
    robot.handle_input(now + MS * 105, b"<TilausAlkaa$3#2$1#>");
    assert_eq!(robot.order(), Some(2));
    let reported = say(&mut robot, now + MS * 150, b"");
    assert!(reported.contains("<LoppuKuittaus$5#3$2$2#>"), "{reported}");
}

/// The only word of a job that was executed ahead of others is its own acknowledgement.
#[test]
fn where_jobs_overtake_one_another_an_order_that_is_broken_off_ends_unknown() {
    for datagrams in [false, true] {
        let robot = if datagrams { RobotConfig::udp() } else { RobotConfig::tcp() };
        let pc = if datagrams { PcConfig::udp() } else { PcConfig::tcp() };
        let robot = RobotConfig { acks: Acks::Individual, ..robot };
        let mut rig = Rig::with(
            1,
            Faults { datagrams, ..Faults::NONE },
            8,
            999,
            robot,
            PcConfig { cumulative_acks: false, max_number: 999, ..pc },
        );
        rig.overtakes = true;
        rig.motion = Some(MS * 30);
        rig.pc.start(1, picture(1, 40)).unwrap();
        rig.run_until(LIMIT, |rig| rig.executed.len() == 5);
        rig.robot.reset_order().unwrap();
        rig.run_until(LIMIT, Rig::is_over);
        let (executed, known) = (rig.pc.executed(), rig.pc.sent());
        assert!(executed < known);
        let unknown = PcEvent::OutcomeUnknown { order: 1, executed, sent: known };
        assert_eq!(rig.pc_events.contains(&unknown), datagrams, "{:?}", rig.pc_events);
    }
}
