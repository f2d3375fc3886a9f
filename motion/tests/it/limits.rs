//! The limits of joints: the files that state them, and the trajectories that exceed them.

use cellwire_motion::{Dimensions, JointLimits, JointSample, LimitError, Limits, LimitsError, Trajectory};

/// J1 to J6 between two angles, as fast as that.
const LIKE: JointLimits = JointLimits { min: -90.0, max: 45.0, speed: 100.0 };

fn path<const N: usize>(samples: [(f64, [f64; 6]); N]) -> Trajectory {
    Trajectory::new(samples.map(|(time, joints)| JointSample { time, joints }).to_vec()).unwrap()
}

/// Returns one joint at this value, and the others at zero.
fn only(joint: u8, value: f64) -> [f64; 6] {
    let mut joints = [0.0; 6];
    joints[usize::from(joint) - 1] = value;
    joints
}

#[test]
fn every_joint_has_its_range_both_ends_of_it_included() {
    let limits = Limits { joints: [LIKE; 6], arm: None };
    for joint in 1..=6 {
        let check = |value| limits.check(&path([(1.0, [0.0; 6]), (5.0, only(joint, value))]));
        let refused = |value| LimitError::Angle { joint, time: 5.0, value, min: -90.0, max: 45.0 };
        assert_eq!([check(-90.0), check(45.0)], [Ok(()); 2], "J{joint}");
        assert_eq!([check(-90.001), check(45.001)], [-90.001, 45.001].map(|value| Err(refused(value))));
        // The first sample has a range too.
        let first = limits.check(&path([(5.0, only(joint, 45.001)), (9.0, [0.0; 6])]));
        assert_eq!(first, Err(refused(45.001)));
    }
}

#[test]
fn every_joint_has_its_speed_from_one_sample_to_the_next() {
    let limits = Limits { joints: [LIKE; 6], arm: None };
    for joint in 1..=6 {
        let check = |from, to| {
            limits.check(&path([(0.0, only(joint, from)), (1.0, only(joint, from)), (1.25, only(joint, to))]))
        };
        let refused = |value| Err(LimitError::Speed { joint, time: 1.25, value, limit: 100.0 });
        assert_eq!([check(-5.0, 20.0), check(20.0, -5.0)], [Ok(()); 2], "25 degrees of J{joint} in 0.25 s");
        assert_eq!([check(-5.0, 20.5), check(20.0, -5.5)], [refused(102.0); 2], "J{joint}");
        assert_eq!(check(5.0, 0.0), Ok(()));
    }
}

/// The data sheet's, with the sign and the size of each.
#[test]
fn the_limits_that_come_with_the_crate_are_those_of_any_arm_and_of_the_data_sheet() {
    let table = |limits: Limits| limits.joints.map(|JointLimits { min, max, speed }| [min, max, speed]);
    assert_eq!(table(Limits::ANY), [[-720.0, 720.0, 2000.0]; 6]);
    assert_eq!(
        table(Limits::LR_MATE_200ID),
        [
            [-170.0, 170.0, 450.0],
            [-100.0, 145.0, 380.0],
            [-70.0, 205.0, 520.0],
            [-190.0, 190.0, 550.0],
            [-125.0, 125.0, 545.0],
            [-360.0, 360.0, 1000.0],
        ]
    );
}

/// Returns a file of six joints and the fields after them.
fn file(joints: [[f64; 3]; 6], more: &str) -> String {
    let rows = joints.map(|[min, max, speed]| format!(r#"{{"min": {min}, "max": {max}, "speed": {speed}}}"#));
    format!("{{\"joints\": [{}]{more}}}", rows.join(",\n"))
}

#[test]
fn a_file_has_six_joints_that_can_move_and_may_have_an_arm() {
    let six = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0].map(|n| [-n, 10.0 * n, 100.0 * n]);
    let joints = six.map(|[min, max, speed]| JointLimits { min, max, speed });
    assert_eq!(Limits::from_json(&file(six, "")), Ok(Limits { joints, arm: None }));
    for (joint, at) in (1..).zip(0..6) {
        let with = |limit: [f64; 3]| {
            let mut six = six;
            six[at] = limit;
            Limits::from_json(&file(six, "")).map(|limits| limits.joints[at])
        };
        let least = JointLimits { min: 5.0, max: 5.001, speed: 0.001 };
        assert_eq!(with([5.0, 5.001, 0.001]), Ok(least));
        for limit in [[5.0, 5.0, 1.0], [5.0, -5.0, 1.0], [0.0, 5.0, 0.0], [0.0, 5.0, -1.0]] {
            assert_eq!(with(limit), Err(LimitsError::Joint { joint }), "{limit:?}");
        }
    }
}

#[test]
fn an_arm_in_a_file_has_two_links_with_a_length() {
    let with = |upper_arm: f64, forearm: f64| {
        let arm = format!(
            r#", "arm": {{"shoulder": 0, "upper_arm": {upper_arm}, "elbow": 0, "forearm": {forearm}, "flange": 0}}"#
        );
        Limits::from_json(&file([[-1.0, 1.0, 1.0]; 6], &arm)).map(|limits| limits.arm.unwrap())
    };
    let arm = |upper_arm, forearm| Dimensions { shoulder: 0.0, upper_arm, elbow: 0.0, forearm, flange: 0.0 };
    assert_eq!(with(0.001, 335.0), Ok(arm(0.001, 335.0)));
    assert_eq!(with(330.0, 0.001), Ok(arm(330.0, 0.001)));
    for (upper_arm, forearm) in [(0.0, 335.0), (330.0, 0.0), (-330.0, 335.0), (330.0, -335.0)] {
        assert_eq!(with(upper_arm, forearm), Err(LimitsError::Arm), "{upper_arm} {forearm}");
    }
}

#[test]
fn a_file_that_is_none_is_refused_where_it_goes_wrong() {
    let refused = |text: &str| match Limits::from_json(text) {
        Err(LimitsError::Json { line, column }) => (line, column),
        other => panic!("{other:?}"),
    };
    assert_eq!(refused(""), (1, 0));
    assert_eq!(refused("{\n  \"joints\": [],\n}"), (2, 14), "no joint at all");
    let six = [[-1.0, 1.0, 1.0]; 6];
    assert_eq!(refused(&file(six, ",\n\"tool\": 1")).0, 7, "a name that nothing has");
    assert_eq!(
        [LimitsError::Joint { joint: 3 }.to_string(), LimitsError::Arm.to_string()],
        ["J3: min must be below max, and speed above 0", "arm: upper_arm and forearm must be above 0"]
    );
}
