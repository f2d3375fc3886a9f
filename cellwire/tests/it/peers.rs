//! Balls that miss packets and balls that are late, and a controller that reports why its arm stands: the real program over real
//! pseudo-terminals, as in `danger.rs`.

use std::time::Duration;

use crate::real_time::in_real_time;
use crate::rig::ball::Faults;
use crate::rig::controller::Cycle;
use crate::rig::{FAST, Rig, x};

/// Five seconds, in cycles.
const LONG: usize = 180;

/// Asserts that the arm, armed once, follows the hand without a break.
fn assert_moves_on(faults: Faults, args: &[&str]) {
    let rig = Rig::new(23, args);
    rig.ball.faults(faults);
    rig.controller.start(23);
    rig.push_until(FAST);
    let since = rig.controller.now();
    rig.controller.pass(LONG);
    let slow = rig.controller.log()[since..].iter().filter(|cycle| x(cycle).is_none_or(|x| x < FAST)).count();
    // A busy machine misses one now and then.
    assert!(slow <= LONG / 20, "{faults:?}, {slow} of {LONG} cycles: {}", rig.terminal.text());
    assert!(!rig.terminal.text().contains("the input sends no new"), "{}", rig.terminal.text());
}

/// One packet in some is old, corrupt or lost: the arm moves on, at each baud rate of the robot's line.
#[test]
fn a_packet_that_is_missing_disarms_nothing() {
    in_real_time(|| {
        let slow: &[&str] = &["--set", "baud=19200"];
        let none = Faults::default();
        assert_moves_on(Faults { of: 4, old: 1, ..none }, slow);
        assert_moves_on(Faults { of: 8, old: 1, ..none }, &[]);
        assert_moves_on(Faults { of: 8, corrupt: 1, ..none }, &[]);
        assert_moves_on(Faults { of: 8, lost: 1, ..none }, slow);
    });
}

/// A ball, or an adapter, that answers each poll later than the line needs: packets have no number.
#[test]
fn a_ball_that_is_late_moves_nothing_and_that_is_said() {
    in_real_time(|| {
        for late in [150, 280] {
            let rig = Rig::new(23, &[]);
            rig.ball.faults(Faults { late: Duration::from_millis(late), ..Faults::default() });
            rig.controller.start(23);
            rig.controller.pass(LONG);
            rig.ball.push(127);
            rig.controller.pass(LONG / 2);
            let log = rig.controller.log();
            assert!(log.iter().filter_map(x).all(|x| x == 0), "{late} ms late: {log:?}");
            rig.terminal.wait_for("answers late");
        }
    });
}

/// The statuses of the motion segment that stop the arm, and disarm; the others are those of a path, or of its end.
const STOPS: [bool; 14] =
    [false, false, false, false, false, true, true, true, true, true, true, true, false, true];

/// While the robot reports that it has stopped the arm nothing moves on, and afterwards nothing moves before the hand has rested.
#[test]
fn a_robot_that_stops_its_arm_disarms_by_each_status_that_says_so() {
    in_real_time(|| {
        let rig = Rig::new(23, &[]);
        rig.controller.start(23);
        for (status, stops) in (1..).zip(STOPS).filter(|(status, _)| *status != 2) {
            rig.push_until(FAST);
            let before = rig.controller.now();
            rig.controller.status(status, 40);
            let of = |cycle: &Cycle| match cycle {
                Cycle::Status(found, [x, ..]) if *found == status => Some(*x),
                _ => None,
            };
            let first = rig.controller.wait("the status", before, |cycle| of(cycle).is_some());
            rig.controller.wait("its end", first, |cycle| x(cycle).is_some());
            rig.controller.pass(10);
            let log = rig.controller.log();
            let during: Vec<i16> = log[first..].iter().filter_map(of).collect();
            let after: Vec<i16> = log[first..].iter().filter_map(x).collect();
            let text = rig.terminal.text();
            if stops {
                let speed = log[..first].iter().rev().find_map(x).unwrap();
                assert!(during[0] < speed, "status {status}: {speed}, then {during:?}");
                assert!(during.windows(2).all(|pair| pair[1] <= pair[0]), "status {status}: {during:?}");
                assert!(during[14..].iter().all(|x| *x == 0), "status {status}: {during:?}");
                assert!(after.iter().all(|x| *x == 0), "status {status}: {after:?}");
                rig.terminal.wait_for(&format!("segment status {status},"));
                rig.terminal.wait_for("the robot has stopped the arm: release");
            } else {
                assert!(during.iter().chain(&after).all(|x| *x >= FAST), "status {status}: {during:?}");
                assert!(text.contains(" MOVING "), "status {status}: {text}");
            }
        }
    });
}
