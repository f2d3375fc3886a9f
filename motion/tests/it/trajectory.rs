//! Tables of joints over time: valid ones, refused ones with the place of the error, and the joints between two samples.

use cellwire_motion::{JointSample, Trajectory, TrajectoryError, TrajectoryReason};

fn sample(time: f64, joints: [f64; 6]) -> JointSample {
    JointSample { time, joints }
}

/// Returns the line, the column and the reason.
fn refused(result: Result<Trajectory, TrajectoryError>) -> (usize, usize, TrajectoryReason) {
    let error = result.unwrap_err();
    (error.line, error.column, error.reason)
}

#[test]
fn a_table_is_read_with_or_without_names_and_in_every_usual_form() {
    let expected =
        [sample(0.0, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), sample(0.008, [1.5, -0.5, 0.001, 4.0, 5.0, 600.0])];
    for text in [
        "time,J1,J2,J3,J4,J5,J6\n0,1,2,3,4,5,6\n0.008,1.5,-.5,1e-3,4,5,+6E2\n",
        "\u{feff}# from the planner\r\n\r\n0;1;2;3;4;5;6\r\n.008; 1.5; -0.5; 0.001; 4; 5; 600\r\n",
        "t\tj\n# in degrees\n0\t1\t2\t3\t4\t5\t6\n \n0.008\t1.5\t-0.5\t0.001\t4\t5\t600",
    ] {
        assert_eq!(Trajectory::from_csv(text).unwrap().samples(), expected, "{text:?}");
    }
}

#[test]
fn a_line_that_is_not_seven_numbers_is_refused_where_it_goes_wrong() {
    let with = |row: &str| refused(Trajectory::from_csv(&format!("time,J1\n\n0,0,0,0,0,0,0\n{row}")));
    for (row, column) in [
        ("x,2,3,4,5,6,7", 1), // a second line of names
        ("  x,2,3,4,5,6,7", 3),
        ("1,2,3, \u{a0}x,5,6,7", 9), // columns are characters
        ("1;22;,4,5,6,7", 6),
        ("1\t2\t3\t4\t5\t6\t 1 2", 14),
        ("1,2,1\u{b0},4,5,6,7", 5),
        ("1,2,1\u{b0},4,x,6,7", 5),
        ("1,2,inf,4,5,6,7", 5),
        ("1,2,-Infinity,4,5,6,7", 5),
        ("1,2,NaN,4,5,6,7", 5),
        ("1,2,1e999,4,5,6,7", 5),
    ] {
        assert_eq!(with(row), (4, column, TrajectoryReason::Number), "{row:?}");
    }
    for (row, found) in [("1", 1), ("1,2,3,4,5,6", 6), ("1,2,3,4,5,6,7,8", 8), ("1,2,3,4,5,6,7,", 8)] {
        assert_eq!(with(row), (4, 1, TrajectoryReason::Columns { found }), "{row:?}");
    }
    let names = refused(Trajectory::from_csv("0,0,0,0,0,0,0\ntime,2,3,4,5,6,7"));
    assert_eq!(names, (2, 1, TrajectoryReason::Number), "names come first");
    let names = refused(Trajectory::from_csv("time\nJ1"));
    assert_eq!(names, (2, 1, TrajectoryReason::Number), "there is one line of names");
}

#[test]
fn a_trajectory_has_two_samples_in_the_order_of_their_times() {
    let read = |times: &[f64]| {
        let rows: Vec<String> = times.iter().map(|time| format!("{time},1,2,3,4,5,6\n")).collect();
        let samples = times.iter().map(|time| sample(*time, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])).collect();
        let (text, list) = (Trajectory::from_csv(&rows.concat()), Trajectory::new(samples));
        assert_eq!(text, list, "{times:?}");
        list
    };
    assert_eq!(refused(read(&[0.0, 86_400.5])), (2, 1, TrajectoryReason::Span));
    assert_eq!(refused(read(&[1e9, 1e9 + 1.0, 1e300])), (3, 1, TrajectoryReason::Span));
    assert!(read(&[1e9, 1e9 + 86_400.0]).is_ok());
    let late = Trajectory::from_csv("t,a\n0,1,2,3,4,5,6\n1e300,1,2,3,4,5,6\n");
    assert_eq!(refused(late), (3, 1, TrajectoryReason::Span));
    assert_eq!(refused(read(&[])), (1, 1, TrajectoryReason::Short));
    assert_eq!(refused(read(&[0.0])), (2, 1, TrajectoryReason::Short));
    assert_eq!(refused(Trajectory::from_csv("# one\n0,1,2,3,4,5,6")), (3, 1, TrajectoryReason::Short));
    assert_eq!(refused(read(&[0.0, 1.0, 1.0])), (3, 1, TrajectoryReason::Time));
    assert_eq!(refused(read(&[0.0, 0.0, 1.0])), (2, 1, TrajectoryReason::Time));
    assert_eq!(refused(read(&[0.0, -0.001, 1.0])), (2, 1, TrajectoryReason::Time));
    assert_eq!(read(&[-3.0, -2.5]).unwrap().span(), (-3.0, -2.5));
    assert_eq!(read(&[1.0, 1.001, 4.0]).unwrap().span(), (1.0, 4.0));
}

#[test]
fn a_trajectory_has_finite_numbers_alone() {
    for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut joints = [0.0; 6];
        assert_eq!(
            refused(Trajectory::new(vec![sample(0.0, joints), sample(number, joints)])),
            (2, 1, TrajectoryReason::Number)
        );
        joints[5] = number;
        assert_eq!(
            refused(Trajectory::new(vec![sample(0.0, joints), sample(1.0, joints)])),
            (1, 1, TrajectoryReason::Number)
        );
    }
}

#[test]
fn j3_from_the_upper_arm_becomes_j3_from_the_horizontal() {
    let path = |j3| {
        let joints = [1.0, 20.0, j3, 4.0, 5.0, 6.0];
        Trajectory::new(vec![sample(0.0, joints), sample(1.0, joints)]).unwrap()
    };
    assert_eq!(path(50.0).from_upper_arm(), path(30.0));
}

#[test]
fn between_two_samples_the_joints_are_on_a_straight_line() {
    let (first, second, third) =
        ([1.0, -2.0, 3.0, -4.0, 5.0, 0.0], [5.0, -6.0, 3.0, 4.0, 1.0, 8.0], [6.0, 0.0, 0.0, 0.0, 0.0, 8.0]);
    let path = Trajectory::new(vec![sample(2.0, first), sample(4.0, second), sample(4.5, third)]).unwrap();
    for (time, expected) in [
        (-9.0, first),
        (2.0, first),
        (2.5, [2.0, -3.0, 3.0, -2.0, 4.0, 2.0]),
        (3.5, [4.0, -5.0, 3.0, 2.0, 2.0, 6.0]),
        (4.0, second),
        (4.25, [5.5, -3.0, 1.5, 2.0, 0.5, 8.0]),
        (4.5, third),
        (9.0, third),
    ] {
        assert_eq!(path.at(time), expected, "at {time} s");
    }
}

#[test]
fn every_reason_says_what_was_expected() {
    let text = |row: &str| Trajectory::from_csv(&format!("0,0,0,0,0,0,0\n{row}")).unwrap_err().to_string();
    assert_eq!(
        [text("1,2,3"), text("1,x,3,4,5,6,7"), text("0,2,3,4,5,6,7"), text("")],
        [
            "line 2, column 1: expected seven columns: time in s, J1 to J6 in degrees; found 3",
            "line 2, column 3: expected a number such as `-108.435`",
            "line 2, column 1: expected a time later than the previous one",
            "line 2, column 1: expected at least two samples",
        ]
    );
}
