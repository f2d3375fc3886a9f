//! Trajectories read from a table and made into spline moves, in the source's three ways.

use cellwire::cell::telemetry::task::{BackgroundTask, TaskError};
use cellwire_motion::{
    Acceleration, Arm, JointSample, Kinematics, Pose, Report, ResampleError, Resampling, Sampling, SpeedStep,
    Trajectory, TrajectoryError, TrajectoryReason,
};
use fanuc_ls::{Document, EncodeError, Instruction, Motion, MotionKind, Program, Rules, Speed, Termination};

/// A robot whose J1 is X in mm and whose J6 turns the tool about Z: what a path does can be read off its joints.
struct Plain;

impl Kinematics for Plain {
    fn forward(&self, joints: &[f64; 6]) -> Pose {
        Pose::shift(joints[0], 0.0, 0.0).then(Pose::turn(2, joints[5]))
    }
}

/// Every 8 ms, J1 and J6 as functions of the time.
fn trajectory(seconds: f64, x: impl Fn(f64) -> f64, turn: impl Fn(f64) -> f64) -> Trajectory {
    let sample = |k: u32| {
        let time = f64::from(k) * 0.008;
        JointSample { time, joints: [x(time), 0.0, 0.0, 0.0, 0.0, turn(time)] }
    };
    Trajectory::new((0..).map(sample).take_while(|s| s.time < seconds + 0.001).collect()).unwrap()
}

/// From 0 to 100 mm/s at 125 mm/s², 1 s at that speed, and down again: the figures of the source's summary.
fn trapezoid(t: f64) -> f64 {
    let (up, speed, rate) = (0.8, 100.0, 125.0);
    match t {
        t if t < up => rate * t * t / 2.0,
        t if t < up + 1.0 => 40.0 + speed * (t - up),
        t if t < 2.6 => 180.0 - rate * (2.6 - t) * (2.6 - t) / 2.0,
        _ => 180.0,
    }
}

fn make(resampling: &Resampling, trajectory: &Trajectory) -> (Program, Report) {
    resampling.program("TEST", "", trajectory, &Plain, &Rules::default()).unwrap()
}

/// X of each point, and the speed of the spline move to it.
fn moves(program: &Program) -> (Vec<f64>, Vec<f64>) {
    let points = program.positions.iter().map(|p| p.joints().unwrap()[0]).collect();
    let speed = |i: &Instruction| match i {
        Instruction::Motion(Motion {
            kind: MotionKind::Spline, speed: Speed::Fixed { value, .. }, ..
        }) => Some(*value),
        _ => None,
    };
    (points, program.instructions.iter().filter_map(speed).collect())
}

fn close(found: f64, expected: f64, within: f64) {
    assert!((found - expected).abs() <= within, "found {found}, expected {expected}");
}

#[test]
fn constant_distance_puts_the_points_at_equal_steps() {
    let (program, report) =
        make(&Resampling::new(Sampling::Distance(25.0)), &trajectory(2.6, trapezoid, |_| 0.0));
    let (points, speeds) = moves(&program);
    let expected = [0.0, 25.0, 50.0, 75.0, 100.0, 125.0, 150.0, 180.0];
    assert_eq!(points.len(), expected.len(), "{points:?}");
    points.iter().zip(expected).for_each(|(found, expected)| close(*found, expected, 1e-6));
    // 25 mm from rest at 125 mm/s² take sqrt(2 · 25 / 125) = 0.6325 s: 39.53 mm/s. From 75 to 100 mm: 100 mm/s.
    assert_eq!((speeds[0], speeds[3]), (40.0, 100.0));
    close(report.length, 180.0, 1e-6);
    close(report.planned_time, 2.6, 1e-9);
    close(report.longest_move, 30.0, 1e-6);
    assert_eq!((report.moves, report.slow_moves), (7, 0));
}

#[test]
fn constant_angle_puts_the_points_at_equal_turns() {
    let path = trajectory(2.0, |t| 50.0 * t, |t| 20.0 * t);
    let (program, report) = make(&Resampling::new(Sampling::Angle(10.0)), &path);
    let turns: Vec<f64> = program.positions.iter().map(|p| p.joints().unwrap()[5]).collect();
    assert_eq!(turns.len(), 5);
    turns
        .iter()
        .zip([0.0, 10.0, 20.0, 30.0, 40.0])
        .for_each(|(found, expected)| close(*found, expected, 1e-6));
    close(report.rotation, 40.0, 1e-6);
    close(report.greatest_turn, 10.0, 1e-6);
}

#[test]
fn constant_time_puts_the_points_at_equal_times() {
    let (program, report) =
        make(&Resampling::new(Sampling::Time(0.25)), &trajectory(2.6, trapezoid, |_| 0.0));
    let (points, _) = moves(&program);
    // The last of the ten full steps ends at 2.5 s; 0.1 s would remain, less than half a step: its point gives way.
    assert_eq!((points.len(), report.moves), (11, 10));
    points.iter().zip(0..10).for_each(|(x, k)| close(*x, trapezoid(f64::from(k) * 0.25), 0.002));
    close(points[10], 180.0, 1e-9);
    close(report.longest_time, 0.35, 1e-9);
}

#[test]
fn dynamic_time_is_dense_where_the_motion_changes() {
    let sampling = Sampling::Dynamic { min: 0.05, max: 0.5, by: Acceleration::Either };
    let (_, report) = make(&Resampling::new(sampling), &trajectory(2.6, trapezoid, |_| 0.0));
    close(report.shortest_time, 0.05, 0.001);
    assert!(report.longest_time > 0.4, "{report:?}");
    // Twice 0.8 s of ramps at 0.05 s, 1 s at up to 0.5 s.
    assert!((32..=38).contains(&report.moves), "{report:?}");
    let all = make(&Resampling::new(Sampling::Time(0.05)), &trajectory(2.6, trapezoid, |_| 0.0)).1;
    assert_eq!(all.moves, 52);
}

#[test]
fn an_acceleration_ends_a_long_step_where_it_begins_and_no_earlier() {
    let path =
        trajectory(2.0, |t| 40.0 * t + if t > 1.0 { 50.0 * (t - 1.0) * (t - 1.0) } else { 0.0 }, |_| 0.0);
    let sampling = Sampling::Dynamic { min: 0.01, max: 0.5, by: Acceleration::Translation };
    let (points, _) = moves(&make(&Resampling::new(sampling), &path).0);
    // Even up to 1 s; seen from 0.01 s before.
    close(points[1], 20.0, 0.01);
    assert!((39.5..40.1).contains(&points[2]), "{points:?}");
    close(points[4] - points[3], 40.0 * 0.01, 0.1);
}

#[test]
fn dynamic_time_looks_at_the_acceleration_that_is_asked_for() {
    // The turn speeds up and slows down in the second second only; the path runs evenly.
    let turn = |t: f64| if t < 1.0 { 0.0 } else { 10.0 * (1.0 - (core::f64::consts::TAU * (t - 1.0)).cos()) };
    let path = trajectory(2.0, |t| 40.0 * t, turn);
    let count = |by| make(&Resampling::new(Sampling::Dynamic { min: 0.02, max: 0.5, by }), &path).1.moves;
    // Rounding alone makes the acceleration of an even path, which must not be taken for one.
    assert_eq!(count(Acceleration::Translation), 4);
    assert!(count(Acceleration::Rotation) > 8);
    assert_eq!(count(Acceleration::Either), count(Acceleration::Rotation));
}

#[test]
fn speeds_are_whole_or_tenths_with_the_rounding_told() {
    let path = trajectory(1.0, |t| 10.33 * t, |_| 0.0);
    let mut resampling = Resampling::new(Sampling::Time(0.5));
    let (program, report) = make(&resampling, &path);
    assert_eq!(moves(&program).1, [10.0, 10.0]);
    close(report.worst_rounding, -0.0319, 0.0001);
    close(report.mean_rounding, 0.0319, 0.0001);
    close(report.written_time, 1.033, 1e-6);
    resampling.speed = SpeedStep::Tenth;
    let (program, report) = make(&resampling, &path);
    assert_eq!(moves(&program).1, [10.3, 10.3]);
    close(report.worst_rounding, -0.0029, 0.0001);
    assert!(program.to_text(&Rules::default()).unwrap().contains("S P[2] 10.3mm/sec CNT100    ;"));
}

#[test]
fn no_speed_is_below_1_and_the_slow_moves_are_counted() {
    let path = trajectory(2.0, |t| if t < 1.0 { 20.0 * t } else { 20.0 }, |t| 30.0 * t);
    let (program, report) = make(&Resampling::new(Sampling::Time(0.5)), &path);
    assert_eq!(moves(&program).1, [20.0, 20.0, 1.0, 1.0]);
    assert_eq!(report.slow_moves, 2);
    assert_eq!(report.worst_rounding, 0.0);
}

#[test]
fn the_program_goes_to_the_start_and_stops_at_the_end() {
    let mut resampling = Resampling::new(Sampling::Time(0.5));
    (resampling.user_frame, resampling.user_tool, resampling.approach) = (3, 4, 7);
    let (program, _) = make(&resampling, &trajectory(1.0, |t| 10.0 * t, |_| 0.0));
    let text = program.to_text(&Rules::default()).unwrap();
    let lines: Vec<&str> = text.lines().skip_while(|line| *line != "/MN").take(10).collect();
    assert_eq!(
        lines[..8],
        [
            "/MN",
            "   1:  UTOOL_NUM=4 ;",
            "   2:  UFRAME_NUM=3 ;",
            "   3:J P[1] 7% FINE    ;",
            "   4:S P[2] 10mm/sec CNT100    ;",
            "   5:S P[3] 10mm/sec FINE    ;",
            "/POS",
            "P[1]{"
        ]
    );
    assert!(lines[9].contains("UF : 3, UT : 4,"));
    assert_eq!(Document::decode(&text).unwrap().findings(&Rules::default()), []);
    assert_eq!(Program::decode(&text).unwrap(), program);
}

#[test]
fn steps_that_make_no_sense_are_refused() {
    let path = trajectory(1.0, |t| 10.0 * t, |_| 0.0);
    let refused =
        |sampling| Resampling::new(sampling).program("A", "", &path, &Plain, &Rules::default()).unwrap_err();
    for step in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(refused(Sampling::Time(step)), ResampleError::Step);
        assert_eq!(refused(Sampling::Distance(step)), ResampleError::Step);
    }
    let by = Acceleration::Either;
    assert_eq!(refused(Sampling::Dynamic { min: 0.2, max: 0.1, by }), ResampleError::Step);
    assert_eq!(refused(Sampling::Time(1e-9)), ResampleError::Points);
    assert_eq!(refused(Sampling::Distance(1e-9)), ResampleError::Points);
    let named = Resampling::new(Sampling::Time(0.5)).program("1", "", &path, &Plain, &Rules::default());
    assert_eq!(named.unwrap_err(), ResampleError::Encode(EncodeError::Name));
}

/// "Fig. 4": from P[1] to P[2] at 10 mm/s, then to P[3] at 31 mm/s. The name gives tdMax 0.5 s, tdMin 0.05 s.
#[test]
fn the_sources_listing_takes_steps_between_its_shortest_and_its_longest() {
    let path = format!("{}/../reference/ls/figure-4.ls", env!("CARGO_MANIFEST_DIR"));
    let program = Program::decode(&std::fs::read_to_string(path).unwrap()).unwrap();
    let pose = |n| Arm::LR_MATE_200ID.forward(&program.position(n).unwrap().joints().unwrap());
    let first = pose(1).distance(&pose(2)) / 10.0;
    let second = pose(2).distance(&pose(3)) / 31.0;
    assert!((0.05..0.5).contains(&first) && (0.05..0.5).contains(&second), "{first} s, {second} s");
    close(second / first, 2.0, 0.25);
}

#[test]
fn a_table_is_read_with_or_without_names_and_in_every_usual_form() {
    let expected = [
        JointSample { time: 0.0, joints: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0] },
        JointSample { time: 0.008, joints: [1.5, -0.5, 0.001, 4.0, 5.0, 6.0] },
    ];
    for text in [
        "time,J1,J2,J3,J4,J5,J6\n0,1,2,3,4,5,6\n0.008,1.5,-.5,1e-3,4,5,6\n",
        "\u{feff}# from the planner\r\n\r\n0;1;2;3;4;5;6\r\n.008; 1.5; -0.5; 0.001; 4; 5; 6\r\n",
        "t\tj\n0\t1\t2\t3\t4\t5\t6\n0.008\t1.5\t-0.5\t0.001\t4\t5\t6",
    ] {
        assert_eq!(Trajectory::from_csv(text).unwrap().samples(), expected, "{text:?}");
    }
}

#[test]
fn a_bad_table_is_refused_with_its_line_and_column() {
    let refused = |text: &str| {
        let TrajectoryError { reason, line, column, .. } = Trajectory::from_csv(text).unwrap_err();
        (reason, line, column)
    };
    let first = "time,J1,J2,J3,J4,J5,J6\n0,0,0,0,0,0,0\n";
    let with = |row: &str| refused(&(first.to_string() + row));
    assert_eq!(with("1,2,3, x,5,6,7"), (TrajectoryReason::Number, 3, 8));
    assert_eq!(with("1,2,inf,4,5,6,7"), (TrajectoryReason::Number, 3, 5));
    assert_eq!(with("1,2,,4,5,6,7"), (TrajectoryReason::Number, 3, 5));
    assert_eq!(with("1,2,3,4,5,6"), (TrajectoryReason::Columns { found: 6 }, 3, 1));
    assert_eq!(with("1,2,3,4,5,6,7,8"), (TrajectoryReason::Columns { found: 8 }, 3, 1));
    assert_eq!(with("0,2,3,4,5,6,7"), (TrajectoryReason::Time, 3, 1));
    assert_eq!(with("name,2,3,4,5,6,7"), (TrajectoryReason::Number, 3, 1));
    assert_eq!(with(""), (TrajectoryReason::Short, 3, 1));
    assert_eq!(refused(""), (TrajectoryReason::Short, 1, 1));
    let error = Trajectory::from_csv(&(first.to_string() + "1,2,3")).unwrap_err();
    assert_eq!(
        error.to_string(),
        "line 3, column 1: expected seven columns: time in s, J1 to J6 in degrees; found 3"
    );
}

#[test]
fn j3_from_the_upper_arm_becomes_j3_from_the_horizontal() {
    let sample = |time| JointSample { time, joints: [1.0, 20.0, 50.0, 4.0, 5.0, 6.0] };
    let path = Trajectory::new(vec![sample(0.0), sample(1.0)]).unwrap().from_upper_arm();
    assert_eq!(path.samples()[1].joints, [1.0, 20.0, 30.0, 4.0, 5.0, 6.0]);
}

#[test]
fn between_samples_the_joints_are_on_a_straight_line() {
    let path = trajectory(1.0, |t| 10.0 * t, |_| 0.0);
    close(path.at(0.5)[0], 5.0, 1e-12);
    close(path.at(0.004)[0], 0.04, 1e-12);
    assert_eq!((path.at(-1.0)[0], path.at(9.0)[0]), (0.0, 10.0));
}

#[test]
fn the_background_task_is_figure_8_to_the_letter() {
    let path = format!("{}/../reference/ls/figure-8.ls", env!("CARGO_MANIFEST_DIR"));
    let figure = Program::decode(&std::fs::read_to_string(path).unwrap()).unwrap();
    let task = BackgroundTask::default().program(&Rules::default()).unwrap();
    assert_eq!(task.instructions.len(), 56);
    assert_eq!(task.instructions, figure.instructions);
    assert_eq!(task.attribute("DEFAULT_GROUP"), Some("*,*,*,*,*"));
    let text = task.to_text(&Rules::default()).unwrap();
    assert!(text.contains("  39:  R[13:SPD_X]=(($SCR_GRP[1].$MCH_POS_X-R[36:POS_PREV_X])/.008) ;\r\n"));
    assert_eq!(Program::decode(&text).unwrap(), task);
}

#[test]
fn the_background_task_takes_other_registers_another_period_and_another_group() {
    let task = BackgroundTask {
        first: 101,
        scratch: 50,
        group: 2,
        period: core::time::Duration::from_millis(12),
        ..BackgroundTask::default()
    };
    let text = task.program(&Rules::default()).unwrap().to_text(&Rules::default()).unwrap();
    assert!(text.contains("   2:  R[101:Life counter]=(R[101:Life counter]+1) ;"));
    assert!(text.contains("  17:  R[50:cy]=(COS[R[51]]) ;"));
    assert!(text.contains("  44:  R[116:SPD_Q1]=((R[109:Q_1]-R[59:POS_PREV_Q1])/.012) ;"));
    assert!(text.contains("($SCR_GRP[2].$MCH_POS_Z)") && !text.contains("SCR_GRP[1]"));
    let refused = |task: BackgroundTask| task.program(&Rules::default()).unwrap_err();
    let base = BackgroundTask::default;
    for (first, scratch) in [(1, 19), (18, 30), (0, 30), (1, 0), (65_530, 1), (1, 65_530)] {
        assert_eq!(
            refused(BackgroundTask { first, scratch, ..base() }),
            TaskError::Registers,
            "{first} {scratch}"
        );
    }
    for micros in [0, 500, 8_500, 1_000_000_000] {
        let period = core::time::Duration::from_micros(micros);
        assert_eq!(refused(BackgroundTask { period, ..base() }), TaskError::Period, "{micros} µs");
    }
    assert!(BackgroundTask { first: 11, scratch: 30, ..base() }.program(&Rules::default()).is_ok());
}

#[test]
fn the_terminations_are_those_of_a_continuous_path() {
    let (program, _) = make(&Resampling::new(Sampling::Time(0.25)), &trajectory(1.0, |t| 10.0 * t, |_| 0.0));
    let ends = program.instructions.iter().filter_map(|i| match i {
        Instruction::Motion(motion) => motion.termination.clone(),
        _ => None,
    });
    let through = Termination::Continuous(100);
    let expected = [Termination::Fine, through.clone(), through.clone(), through, Termination::Fine];
    assert_eq!(ends.collect::<Vec<_>>(), expected);
}

/// A table with three decimals moves the tool by steps of 10 µm: between 8 ms apart, that looks like 190 mm/s².
#[test]
fn the_last_decimal_of_a_table_is_no_acceleration() {
    let round = |x: f64| (x * 1000.0).round() / 1000.0;
    let sampling = Sampling::Dynamic { min: 0.05, max: 0.5, by: Acceleration::Either };
    let exact = make(&Resampling::new(sampling), &trajectory(2.6, trapezoid, |_| 0.0)).1;
    let rounded = make(&Resampling::new(sampling), &trajectory(2.6, |t| round(trapezoid(t)), |_| 0.0)).1;
    assert!(rounded.moves.abs_diff(exact.moves) <= 4, "{} and {}", rounded.moves, exact.moves);
}

#[test]
fn a_trajectory_has_two_samples_in_the_order_of_their_times() {
    let sample = |time: f64| JointSample { time, joints: [time; 6] };
    let reason = |samples: &[JointSample]| {
        let error = Trajectory::new(samples.to_vec()).unwrap_err();
        (error.line, error.column, error.reason)
    };
    assert_eq!(reason(&[]), (1, 1, TrajectoryReason::Short));
    assert_eq!(reason(&[sample(0.0)]), (2, 1, TrajectoryReason::Short));
    assert_eq!(reason(&[sample(0.0), sample(1.0), sample(1.0)]), (3, 1, TrajectoryReason::Time));
    assert_eq!(reason(&[sample(0.0), sample(f64::NAN)]), (2, 1, TrajectoryReason::Number));
    let tilted = JointSample { joints: [0.0, 0.0, 0.0, 0.0, 0.0, f64::INFINITY], ..sample(1.0) };
    assert_eq!(reason(&[sample(0.0), tilted]), (2, 1, TrajectoryReason::Number));
    let whole = Trajectory::new(vec![sample(1.0), sample(3.0)]).unwrap();
    assert_eq!(
        (whole.span(), whole.at(0.0)[5], whole.at(1.5)[5], whole.at(9.0)[5]),
        ((1.0, 3.0), 1.0, 1.5, 3.0)
    );
}

#[test]
fn more_points_than_a_program_holds_are_refused_in_every_way_of_sampling() {
    let sample = |time: f64| JointSample { time, joints: [time, 0.0, 0.0, 0.0, 30.0, time] };
    let trajectory = Trajectory::new(vec![sample(0.0), sample(80.0)]).unwrap();
    let (min, max, by) = (1e-5, 1e-5, Acceleration::Either);
    for sampling in [
        Sampling::Time(1e-5),
        Sampling::Distance(1e-5),
        Sampling::Angle(1e-5),
        Sampling::Dynamic { min, max, by },
    ] {
        let made =
            Resampling::new(sampling).program("A", "", &trajectory, &Arm::LR_MATE_200ID, &Rules::default());
        let error = made.unwrap_err();
        assert_eq!(error, ResampleError::Points, "{sampling:?}");
    }
    for sampling in
        [Sampling::Time(0.0), Sampling::Angle(f64::NAN), Sampling::Dynamic { min: 2.0, max: 1.0, by }]
    {
        let made =
            Resampling::new(sampling).program("A", "", &trajectory, &Arm::LR_MATE_200ID, &Rules::default());
        assert_eq!(made.unwrap_err(), ResampleError::Step, "{sampling:?}");
    }
}
