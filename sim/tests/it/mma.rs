//! The MM&A robot that misbehaves, over TCP and for a day on a virtual clock.

use core::time::Duration;

use cellwire_sim::mma::{MmaDevice, MmaEvent, MmaRobot, MotionFaults, MotionOutcome};
use cellwire_sim::{Bench, Device as _, Fault, Settings as _, SimulatorReport};
use mmacell_proto::robot_session::tokio::{Reconnect, Tcp};
use mmacell_proto::tokio::{Error, central};
use mmacell_proto::{
    Central, CentralConfig, CentralEvent, Command, ErrorCode, MissReason, Mode, Progress, Rejection,
    RobotPose,
};

const MS: Duration = Duration::from_millis(1);
const S: Duration = Duration::from_secs(1);

fn pose(x: f64) -> RobotPose {
    RobotPose::from_mm_rad(x, 0.0, 100.0, 0.0)
}

#[tokio::test]
async fn a_robot_that_stalls_refuses_and_restarts() {
    let faults = MotionFaults { stall_every: 2, refuse_every: 3, refuse_code: 9, fail_every: 0 };
    let sim = MmaRobot { speed: 1000, faults, ..MmaRobot::default() }.listen("127.0.0.1:0").unwrap();
    let (robot, task) = central(CentralConfig::DEFAULT, Tcp::new(sim.address().to_string())).unwrap();
    tokio::spawn(task.reconnect(Reconnect { first: 5 * MS, longest: 50 * MS }).run());
    robot.command(Command::Servo { on: true }).await.unwrap();
    assert_eq!(robot.move_to(pose(100.0)).await.unwrap().pose, pose(100.0));
    assert!(matches!(robot.move_to(pose(200.0)).await, Err(Error::Missed(MissReason::Elsewhere))));
    let refused = robot.move_to(pose(200.0)).await;
    assert!(matches!(refused, Err(Error::Refused(error)) if error == ErrorCode::from(9)), "{refused:?}");
    sim.faults().next_request(Fault::Restart(20 * MS));
    let unknown = robot.move_to(pose(0.0)).await;
    assert!(matches!(unknown, Err(Error::Unknown(_))), "{unknown:?}");
    robot.handle().connected().await.unwrap();
    let (status, progress) = robot.status().await.unwrap();
    assert_eq!(
        (status.pose, status.servo, progress),
        (pose(150.0), false, Progress::Still),
        "where it stood"
    );
    let ends: Vec<_> = sim.executed().iter().map(|done| done.work.at).collect();
    assert_eq!(ends, [pose(100.0), pose(150.0)]);
}

/// Eight hours of pick and place: no motion begins before the previous one has ended.
#[test]
fn eight_hours_take_no_time() {
    let mut bench = MmaRobot::default().bench(Central::new(CentralConfig::DEFAULT).unwrap()).unwrap();
    bench.session_mut();
    bench.run_for(S);
    bench.session_mut().request(Command::Servo { on: true }).unwrap();
    bench.run_for(S);
    let mut moves = 0u64;
    while bench.now() < 8 * 3600 * S {
        moves += 1;
        let target = pose(if moves.is_multiple_of(2) { 0.0 } else { 250.0 });
        bench.session_mut().request(Command::Move { mode: Mode::Absolute, pose: target }).unwrap();
        assert!(bench.run_until(10 * S, |bench| bench.executed().len() as u64 == moves), "{moves}");
        let done = bench.executed().last().unwrap();
        assert_eq!(done.work.at, target);
    }
    let events: Vec<CentralEvent<RobotPose>> = bench.take_events().collect();
    assert!(moves > 10_000 && events.len() as u64 > moves, "{moves}");
}

/// The robot does not report its arrival: time passes to that moment because the device returns it as a deadline.
#[test]
fn a_motion_ends_when_it_is_due_at_any_speed() {
    let there = pose(250.0);
    for speed in [1, 3] {
        let robot = MmaRobot { speed, home: pose(0.0), ..MmaRobot::default() };
        let mut bench = robot.bench(Central::new(CentralConfig::DEFAULT).unwrap()).unwrap();
        bench.run_for(S);
        bench.session_mut().request(Command::Servo { on: true }).unwrap();
        bench.run_for(S);
        bench.session_mut().request(Command::Move { mode: Mode::Absolute, pose: there }).unwrap();
        assert!(bench.run_until(S, |bench| bench.device().moves()));
        let begun = bench.now();
        let ends = bench.device().due().unwrap();
        let took = ends - begun;
        assert!(took.abs_diff(S * 3 / 2 / speed) < MS / 1000, "{took:?} at {speed}");
        assert!(bench.run_until(9 * S, |bench| !bench.executed().is_empty()));
        assert_eq!((bench.now(), bench.executed()[0].at), (ends, ends));
        assert_eq!((bench.device().moves(), bench.device().due()), (false, None));
    }
}

#[test]
fn what_a_robot_is_told_and_cannot_do_it_tells() {
    let mut bench = MmaRobot::default().bench(Central::new(CentralConfig::DEFAULT).unwrap()).unwrap();
    bench.run_for(S);
    bench.session_mut().request(Command::Servo { on: true }).unwrap();
    bench.run_for(S);
    bench.session_mut().request(Command::Servo { on: false }).unwrap();
    bench.run_for(S);
    bench.session_mut().request(Command::Move { mode: Mode::Absolute, pose: pose(1.0) }).unwrap();
    bench.run_for(S);
    let told: Vec<_> = bench.told().iter().map(|(_, told)| *told).collect();
    assert_eq!(told[..2], [true, false].map(|on| SimulatorReport::Device(MmaEvent::Servo(on))));
    let rejected =
        |told| matches!(told, SimulatorReport::Device(MmaEvent::Rejected(Rejection::NotNow { .. })));
    assert!(told.len() == 3 && rejected(told[2]), "{told:?}");
}

/// Returns a robot at 0 whose servo motors are on.
fn ready() -> Bench<Central<RobotPose>, MmaDevice<RobotPose>> {
    let robot = MmaRobot { home: pose(0.0), ..MmaRobot::default() };
    let mut bench = robot.bench(Central::new(CentralConfig::DEFAULT).unwrap()).unwrap();
    bench.run_for(S);
    bench.session_mut().request(Command::Servo { on: true }).unwrap();
    bench.run_for(S);
    bench
}

/// Begins a motion to 250 mm, which takes 1.5 s.
fn begin(bench: &mut Bench<Central<RobotPose>, MmaDevice<RobotPose>>) -> Duration {
    bench.session_mut().request(Command::Move { mode: Mode::Absolute, pose: pose(250.0) }).unwrap();
    assert!(bench.run_until(S, |bench| bench.device().moves()));
    bench.device().due().unwrap() - bench.now()
}

fn status(bench: &mut Bench<Central<RobotPose>, MmaDevice<RobotPose>>) -> (RobotPose, bool, bool, ErrorCode) {
    bench.session_mut().request(Command::Status).unwrap();
    loop {
        if let CentralEvent::Status { status, .. } = bench.next_event(S).unwrap() {
            return (status.pose, status.moving, status.servo, status.error);
        }
    }
}

#[test]
fn a_motion_that_is_under_way_ends_as_it_is_decided() {
    for (fate, at, error) in [
        (MotionOutcome::Arrives, 250.0, ErrorCode::from(0)),
        (MotionOutcome::Fails, 125.0, ErrorCode::Servo1),
        (MotionOutcome::Stalls, 125.0, ErrorCode::from(0)),
    ] {
        let mut bench = ready();
        begin(&mut bench);
        bench.device_mut().end_motion(fate);
        bench.run_for(9 * S);
        let (there, moves, _, found) = status(&mut bench);
        assert_eq!((there, moves, found), (pose(at), false, error), "{fate:?}");
    }
}

#[test]
fn a_motion_at_half_of_the_override_takes_twice_the_time() {
    let mut bench = ready();
    bench.session_mut().request(Command::Override { percent: 50 }).unwrap();
    bench.run_for(S);
    assert_eq!(bench.told().last().unwrap().1, SimulatorReport::Device(MmaEvent::Override(50)));
    let took = begin(&mut bench);
    assert!(took.abs_diff(3 * S) < MS / 1000, "{took:?}");
}

#[test]
fn a_motion_that_is_forgotten_ends_where_it_is_and_the_servo_motors_stay_on() {
    let mut bench = ready();
    let took = begin(&mut bench);
    bench.run_for(took / 2);
    bench.faults().forget();
    bench.run_for(9 * S);
    let (there, moves, servo, error) = status(&mut bench);
    assert_eq!((moves, servo, error), (false, true, ErrorCode::from(0)));
    let [least, x, most] = [pose(120.0), there, pose(130.0)].map(|pose| pose.units()[0]);
    assert!((least..most).contains(&x), "{there:?}");
    assert_eq!((bench.executed(), bench.device().due()), (&[][..], None), "it has not ended by itself");
}
