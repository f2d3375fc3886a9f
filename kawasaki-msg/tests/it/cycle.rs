//! The robot's cycle: an answer is waited for, and counted.

use core::time::Duration;

use kawasaki_msg::robot::machine::Link;
use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::robot_session::end::End as _;
use kawasaki_msg::{Line, Robot, RobotConfig, RobotEvent};

use crate::jobs::MS;

/// §10.4: "The robot waits a certain time for an answer; if none comes, it goes back to the start of its cycle."
#[test]
fn an_answer_is_waited_for_but_not_for_ever() {
    let (writer, _reader) = robot_work_queue::boxed(8, 9999).unwrap();
    let mut robot = Robot::<Line>::new(RobotConfig::tcp(), writer).unwrap();
    let mut out = [0; 4096];
    assert_eq!(robot.poll_timeout(), Some(Duration::ZERO));
    assert_eq!(robot.poll_event(), None);
    robot.handle_timeout(Duration::ZERO);
    assert_eq!(robot.poll_event(), Some(RobotEvent::Connect));
    assert_eq!((robot.machine().link, robot.poll_timeout()), (Link::Connecting { reported: true }, None));
    robot.handle_connected(Duration::ZERO);
    let second = Duration::from_secs(1);
    for cycle in 1..5 {
        assert!(robot.poll_transmit(second * (cycle - 1), &mut out).is_some());
        assert_eq!(robot.poll_timeout(), Some(second * cycle));
        robot.handle_timeout(second * cycle - MS);
        assert_eq!(robot.poll_transmit(second * cycle - MS, &mut out), None);
        assert_eq!(robot.poll_event(), None);
        robot.handle_timeout(second * cycle);
        assert_eq!(robot.poll_event(), Some(RobotEvent::NoReply));
    }
    robot.poll_transmit(second * 4, &mut out).unwrap();
    robot.handle_timeout(second * 5);
    assert_eq!(robot.poll_event(), Some(RobotEvent::NoReply));
    assert_eq!(robot.poll_event(), Some(RobotEvent::Disconnect), "the fifth cycle without an answer");
    robot.handle_disconnected(second * 5);
    assert_eq!(robot.poll_timeout(), Some(second * 6));
    robot.handle_timeout(second * 6);
    assert_eq!(robot.poll_event(), Some(RobotEvent::Connect));
    assert_eq!(robot.statistics().unanswered, 5);
}

#[test]
fn an_answer_within_the_time_begins_the_next_cycle_after_32_ms() {
    let (writer, _reader) = robot_work_queue::boxed(8, 9999).unwrap();
    let mut robot = Robot::<Line>::new(RobotConfig::tcp(), writer).unwrap();
    let mut out = [0; 4096];
    robot.handle_timeout(Duration::ZERO);
    robot.handle_connected(Duration::ZERO);
    robot.poll_transmit(Duration::ZERO, &mut out).unwrap();
    robot.handle_input(5 * MS, b"<Huuhaa$0##><Huu");
    assert_eq!(robot.poll_timeout(), Some(Duration::from_secs(1)), "the answer is not whole");
    robot.handle_input(6 * MS, b"haa$0##>");
    assert_eq!(robot.poll_timeout(), Some(32 * MS));
    assert_eq!(robot.poll_transmit(31 * MS, &mut out), None);
    assert!(robot.poll_transmit(32 * MS, &mut out).is_some());
    robot.handle_input(72 * MS, b"<Huuhaa$0##>");
    assert_eq!(
        robot.poll_timeout(),
        Some(74 * MS),
        "a late answer makes the next cycle wait for its end alone"
    );
    let exchange = robot.statistics().exchange;
    assert_eq!((exchange.last(), exchange.mean()), (Some(40 * MS), Some(23 * MS)));
    robot.record_unpack(27 * MS);
    assert_eq!(robot.statistics().unpack.last(), Some(27 * MS));
    assert_eq!(robot.statistics().packets, 2);
}

#[test]
fn a_robot_without_a_motion_task_takes_no_order() {
    let (writer, reader) = robot_work_queue::boxed(8, 9999).unwrap();
    let mut robot = Robot::<Line>::new(RobotConfig::tcp(), writer).unwrap();
    assert!(!robot.is_abandoned());
    drop(reader);
    assert!(robot.is_abandoned());
    robot.handle_timeout(Duration::ZERO);
    robot.handle_connected(Duration::ZERO);
    let mut out = [0; 4096];
    robot.poll_transmit(Duration::ZERO, &mut out).unwrap();
    robot.handle_input(5 * MS, b"<TilausAlkaa$4#50$1#>");
    let length = robot.poll_transmit(32 * MS, &mut out).unwrap();
    assert!(out[..length].starts_with(b"<TilausKuittaus$1#0#>"), "refused, and by no order");
}
