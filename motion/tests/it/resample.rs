//! Trajectories made into spline moves: the chosen points, the speed of each move, and the report. The figures are computed
//! by hand; times and ways are such that binary fractions hold them exactly.

use cellwire_motion::{
    Acceleration, Arm, JointSample, Kinematics, Pose, Report, ResampleError, Resampling, Sampling, SpeedStep,
    Trajectory,
};
use fanuc_ls::{EncodeError, Instruction, Motion, MotionKind, Program, Rules, Speed};

/// J1 moves the tool along (2, 3, 6), 7 mm for each of its degrees; J6 turns it about the same axis.
struct Plain;

impl Kinematics for Plain {
    fn forward(&self, &[j1, _, _, _, _, j6]: &[f64; 6]) -> Pose {
        let (sine, cosine) = (j6.to_radians() / 2.0).sin_cos();
        let [x, y, z] = [2.0, 3.0, 6.0].map(|part| part / 7.0 * sine);
        Pose { position: [2.0 * j1, 3.0 * j1, 6.0 * j1], orientation: [cosine, x, y, z] }
    }
}

/// Returns the positions of the tool (in s, mm and degrees). J2, which moves nothing here, is the time: a point tells
/// its own.
fn path(samples: &[(f64, f64, f64)]) -> Trajectory {
    let sample = |&(time, mm, degrees): &(f64, f64, f64)| JointSample {
        time,
        joints: [mm / 7.0, time, 0.0, 0.0, 0.0, degrees],
    };
    Trajectory::new(samples.iter().map(sample).collect()).unwrap()
}

fn make(resampling: &Resampling, trajectory: &Trajectory) -> (Program, Report) {
    resampling.program("TEST", "", trajectory, &Plain, &Rules::default()).unwrap()
}

fn refused(sampling: Sampling, trajectory: &Trajectory) -> ResampleError {
    Resampling::new(sampling).program("TEST", "", trajectory, &Plain, &Rules::default()).unwrap_err()
}

fn times_of(program: &Program) -> Vec<f64> {
    program.positions.iter().map(|point| point.joints().unwrap()[1]).collect()
}

fn times(sampling: Sampling, samples: &[(f64, f64, f64)]) -> Vec<f64> {
    times_of(&make(&Resampling::new(sampling), &path(samples)).0)
}

fn speeds(program: &Program) -> Vec<f64> {
    let speed = |instruction: &Instruction| match instruction {
        Instruction::Motion(Motion {
            kind: MotionKind::Spline, speed: Speed::Fixed { value, .. }, ..
        }) => Some(*value),
        _ => None,
    };
    program.instructions.iter().filter_map(speed).collect()
}

#[track_caller]
fn close(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-9, "found {found}, expected {expected}");
}

#[test]
fn the_program_goes_to_the_first_sample_and_by_splines_to_the_last() {
    let mut resampling = Resampling::new(Sampling::Time(2.5));
    let trajectory = path(&[(10.0, 0.0, 0.0), (12.5, 70.0, 10.0), (15.0, 105.0, 10.0), (17.5, 112.0, 90.0)]);
    let text = |resampling: &Resampling| {
        let program = resampling.program("WAY", "by hand", &trajectory, &Plain, &Rules::default()).unwrap().0;
        program.to_text(&Rules::default()).unwrap()
    };
    let lines = |text: &str| {
        text.lines().skip_while(|line| *line != "/MN").take(9).map(str::to_string).collect::<Vec<_>>()
    };
    let found = text(&resampling);
    assert!(found.starts_with("/PROG  WAY\r\n") && found.contains("\"by hand\""), "{found}");
    let moves = |tool, frame, approach| {
        [
            "/MN".to_string(),
            format!("   1:  UTOOL_NUM={tool} ;"),
            format!("   2:  UFRAME_NUM={frame} ;"),
            format!("   3:J P[1] {approach}% FINE    ;"),
            "   4:S P[2] 28mm/sec CNT100    ;".to_string(),
            "   5:S P[3] 14mm/sec CNT100    ;".to_string(),
            "   6:S P[4] 3mm/sec FINE    ;".to_string(),
            "/POS".to_string(),
            "P[1]{".to_string(),
        ]
    };
    assert_eq!(lines(&found), moves(1, 0, 2));
    (resampling.user_tool, resampling.user_frame, resampling.approach) = (4, 3, 7);
    let found = text(&resampling);
    assert_eq!(lines(&found), moves(4, 3, 7));
    assert_eq!(found.matches("UF : 3, UT : 4,").count(), 4);
    let (program, _) = make(&resampling, &trajectory);
    let joints: Vec<_> = program.positions.iter().map(|point| point.joints().unwrap()).collect();
    assert_eq!(joints, trajectory.samples().iter().map(|sample| sample.joints).collect::<Vec<_>>());
}

#[test]
fn points_at_equal_times_count_from_the_first_sample() {
    let until = |end| times(Sampling::Time(2.5), &[(10.0, 0.0, 0.0), (end, 70.0, 0.0)]);
    assert_eq!(until(17.5), [10.0, 12.5, 15.0, 17.5]);
    // Half a step remains: a step of its own. Less than half: the point before gives way.
    assert_eq!(until(16.25), [10.0, 12.5, 15.0, 16.25]);
    assert_eq!(until(16.0), [10.0, 12.5, 16.0]);
    assert_eq!(until(12.5), [10.0, 12.5]);
    assert_eq!(until(11.0), [10.0, 11.0]);
}

#[test]
fn points_at_equal_ways_are_where_the_tool_has_gone_so_far() {
    let to = |samples: &[(f64, f64)]| {
        let samples: Vec<_> = samples.iter().map(|&(time, mm)| (time, mm, 0.0)).collect();
        times(Sampling::Distance(14.0), &samples)
    };
    let long = [(10.0, 0.0), (11.0, 28.0), (13.0, 84.0), (14.0, 91.0)];
    assert_eq!(to(&long), [10.0, 10.5, 11.0, 11.5, 12.0, 12.5, 13.0, 14.0]);
    assert_eq!(to(&[(10.0, 0.0), (11.0, 28.0), (12.0, 33.25)]), [10.0, 10.5, 12.0]);
    assert_eq!(to(&[(10.0, 0.0), (12.0, 6.0)]), [10.0, 12.0]);
    // The way counts, there and back; if the tool rests before the end, the end is one of the points.
    assert_eq!(to(&[(10.0, 0.0), (11.0, 28.0), (12.0, 14.0)]), [10.0, 10.5, 11.0, 12.0]);
    assert_eq!(to(&[(10.0, 0.0), (11.0, 28.0), (13.0, 28.0)]), [10.0, 10.5, 13.0]);
}

#[test]
fn points_at_equal_turns_are_where_the_tool_has_turned_so_far() {
    let to = |end| times(Sampling::Angle(20.0), &[(10.0, 0.0, 0.0), (11.0, 7.0, 40.0), (12.0, 14.0, end)]);
    assert_eq!(to(49.0), [10.0, 10.5, 12.0]);
    assert_eq!(to(51.0), [10.0, 10.5, 11.0, 12.0]);
    assert_eq!(to(80.0), [10.0, 10.5, 11.0, 11.5, 12.0]);
    assert_eq!(times(Sampling::Angle(20.0), &[(10.0, 0.0, 0.0), (12.0, 70.0, 8.0)]), [10.0, 12.0]);
}

/// Turns by half a revolution, then by a quarter, of which binary fractions hold the angles.
struct Flips;

impl Kinematics for Flips {
    fn forward(&self, joints: &[f64; 6]) -> Pose {
        let half = core::f64::consts::FRAC_1_SQRT_2;
        let orientation = match joints[5] {
            0.0 => [1.0, 0.0, 0.0, 0.0],
            180.0 => [0.0, 1.0, 0.0, 0.0],
            _ => [-half, half, 0.0, 0.0],
        };
        Pose { orientation, ..Pose::IDENTITY }
    }
}

#[test]
fn a_last_turn_of_half_a_step_is_a_step_of_its_own() {
    let trajectory = path(&[(10.0, 0.0, 0.0), (11.0, 0.0, 180.0), (12.0, 0.0, 270.0)]);
    let resampling = Resampling::new(Sampling::Angle(180.0));
    let (program, report) = resampling.program("TEST", "", &trajectory, &Flips, &Rules::default()).unwrap();
    assert_eq!((report.rotation, report.greatest_turn), (270.0, 180.0));
    assert_eq!(times_of(&program), [10.0, 11.0, 12.0]);
}

#[test]
fn an_even_motion_takes_the_longest_steps_and_a_last_one_of_the_shortest_at_least() {
    let until = |end: f64, min| {
        let sampling = Sampling::Dynamic { min, max: 2.0, by: Acceleration::Either };
        times(sampling, &[(10.0, 0.0, 0.0), (end, 7.0 * (end - 10.0), 0.0)])
    };
    assert_eq!(until(16.5, 0.5), [10.0, 12.0, 14.0, 16.0, 16.5]);
    assert_eq!(until(16.375, 0.5), [10.0, 12.0, 14.0, 16.375]);
    assert_eq!(until(16.0, 2.0), [10.0, 12.0, 14.0, 16.0]);
    assert_eq!(until(10.25, 0.5), [10.0, 10.25]);
}

/// Returns a sample each second from 10 s on, at these rates until the next.
fn at_rates(rates: &[f64]) -> Vec<(f64, f64)> {
    let mut last = (10.0, 0.0);
    let next = |rate| {
        last = (last.0 + 1.0, last.1 + rate);
        last
    };
    core::iter::once((10.0, 0.0)).chain(rates.iter().copied().map(next)).collect()
}

fn gone(samples: &[(f64, f64)]) -> Vec<(f64, f64, f64)> {
    samples.iter().map(|&(time, mm)| (time, mm, 0.0)).collect()
}

fn turned(samples: &[(f64, f64)]) -> Vec<(f64, f64, f64)> {
    samples.iter().map(|&(time, degrees)| (time, 0.0, degrees)).collect()
}

#[test]
fn the_greater_the_acceleration_the_shorter_the_step_from_it_and_no_step_passes_it() {
    let sampling = |by| Sampling::Dynamic { min: 0.125, max: 1.625, by };
    // At 12 s the rate changes by 56, at 15 s by half as much. The rest before and after the trajectory counts as none.
    let samples = at_rates(&[70.0, 70.0, 126.0, 126.0, 126.0, 98.0, 98.0, 98.0]);
    let expected = [10.0, 11.625, 12.0, 12.125, 13.75, 15.0, 15.875, 17.5, 18.0];
    let even = [10.0, 11.625, 13.25, 14.875, 16.5, 18.0];
    assert_eq!(times(sampling(Acceleration::Translation), &gone(&samples)), expected);
    assert_eq!(times(sampling(Acceleration::Either), &gone(&samples)), expected);
    assert_eq!(times(sampling(Acceleration::Rotation), &gone(&samples)), even);
    assert_eq!(times(sampling(Acceleration::Rotation), &turned(&samples)), expected);
    assert_eq!(times(sampling(Acceleration::Either), &turned(&samples)), expected);
    assert_eq!(times(sampling(Acceleration::Translation), &turned(&samples)), even);
}

#[test]
fn either_acceleration_is_the_greater_share() {
    let sampling = Sampling::Dynamic { min: 0.125, max: 1.625, by: Acceleration::Either };
    // The way changes at 12 s, its greatest change, and at 15 s by half of it; the turn at 15 s by its greatest.
    let way = at_rates(&[70.0, 70.0, 126.0, 126.0, 126.0, 98.0, 98.0, 98.0]);
    let turn = at_rates(&[7.0, 7.0, 7.0, 7.0, 7.0, 14.0, 14.0, 14.0]);
    let both: Vec<_> =
        way.iter().zip(&turn).map(|(&(time, mm), &(_, degrees))| (time, mm, degrees)).collect();
    assert_eq!(times(sampling, &both), [10.0, 11.625, 12.0, 12.125, 13.75, 15.0, 15.125, 16.75, 18.0]);
}

#[test]
fn an_acceleration_below_the_least_that_counts_is_a_share_of_that() {
    // 0.0625 in 0.125 s: half of 1 mm/s², or of 1 °/s².
    let samples = at_rates(&[7.0, 7.0, 7.0625, 7.0625, 7.0625]);
    for (by, samples) in
        [(Acceleration::Translation, gone(&samples)), (Acceleration::Rotation, turned(&samples))]
    {
        let found = times(Sampling::Dynamic { min: 0.125, max: 1.625, by }, &samples);
        assert_eq!(found, [10.0, 11.625, 12.5, 14.125, 15.0], "{by:?}");
    }
}

#[test]
fn a_trajectory_shorter_than_two_of_the_shortest_steps_has_no_acceleration() {
    let sampling = |max| Sampling::Dynamic { min: 1.25, max, by: Acceleration::Translation };
    let two = [(100.0, 0.0, 0.0), (101.25, 7.0, 0.0), (102.5, 70.0, 0.0)];
    assert_eq!(times(sampling(2.5), &two), [100.0, 101.25, 102.5]);
    let shorter = [(100.0, 0.0, 0.0), (101.25, 7.0, 0.0), (102.375, 70.0, 0.0)];
    assert_eq!(times(sampling(2.5), &shorter), [100.0, 102.375]);
}

#[test]
fn the_report_says_what_became_of_the_trajectory() {
    let trajectory = path(&[(10.0, 0.0, 0.0), (11.0, 14.0, 10.0), (14.0, 75.2, 46.0), (16.5, 76.2, 50.0)]);
    let (program, report) = make(&Resampling::new(Sampling::Time(2.0)), &trajectory);
    assert_eq!(times_of(&program), [10.0, 12.0, 14.0, 16.5]);
    // 34.4 mm and 40.8 mm in 2 s each, at 17.2 and 20.4 mm/s; 1 mm in 2.5 s.
    assert_eq!(speeds(&program), [17.0, 20.0, 1.0]);
    assert_eq!((report.moves, report.slow_moves, report.worst_point), (3, 1, 3));
    close(report.length, 76.2);
    close(report.rotation, 50.0);
    close(report.planned_time, 6.5);
    close(report.written_time, 34.4 / 17.0 + 2.04 + 1.0);
    close(report.worst_rounding, -0.4 / 20.4);
    close(report.mean_rounding, (0.2 / 17.2 + 0.4 / 20.4) / 2.0);
    close(report.longest_move, 40.8);
    close(report.greatest_turn, 24.0);
    close(report.shortest_time, 2.0);
    close(report.longest_time, 2.5);
}

#[test]
fn the_shortest_and_the_longest_move_are_found_wherever_they_are() {
    let times = |rates: &[f64]| {
        let trajectory = path(&gone(&at_rates(rates)));
        let report = make(&Resampling::new(Sampling::Distance(14.0)), &trajectory).1;
        (report.shortest_time, report.longest_time, report.longest_move)
    };
    assert_eq!(times(&[14.0, 28.0, 7.0]), (0.5, 1.0, 14.0));
    assert_eq!(times(&[28.0, 7.0, 14.0]), (0.5, 1.5, 14.0));
    assert_eq!(times(&[28.0, 14.0, 3.5]), (0.5, 2.0, 17.5));
}

#[test]
fn of_equal_roundings_the_first_is_the_worst() {
    let (program, report) =
        make(&Resampling::new(Sampling::Time(2.0)), &path(&[(10.0, 0.0, 0.0), (18.0, 84.0, 0.0)]));
    assert_eq!(speeds(&program), [11.0; 4]);
    assert_eq!(report.worst_point, 2);
    close(report.worst_rounding, 0.5 / 10.5);
    close(report.mean_rounding, 0.5 / 10.5);
}

#[test]
fn a_move_below_1_mm_s_is_slow_and_no_rounding() {
    let made = |mm| make(&Resampling::new(Sampling::Time(7.0)), &path(&[(10.0, 0.0, 0.0), (17.0, mm, 45.0)]));
    for (mm, slow) in [(7.0, 0), (6.9, 1), (0.0, 1)] {
        let (program, report) = made(mm);
        assert_eq!(speeds(&program), [1.0]);
        assert_eq!((report.moves, report.slow_moves, report.worst_point), (1, slow, 0), "{mm} mm");
        assert_eq!((report.worst_rounding, report.mean_rounding), (0.0, 0.0), "{mm} mm");
        close(report.written_time, mm);
    }
}

#[test]
fn speeds_are_written_in_whole_mm_s_or_in_tenths() {
    let written = |mm, speed| {
        let mut resampling = Resampling::new(Sampling::Time(1.0));
        resampling.speed = speed;
        speeds(&make(&resampling, &path(&[(10.0, 0.0, 0.0), (11.0, mm, 0.0)])).0)[0]
    };
    let rounded = |mm| [SpeedStep::Whole, SpeedStep::Tenth].map(|step| written(mm, step));
    assert_eq!(rounded(10.33), [10.0, 10.3]);
    assert_eq!(rounded(10.5), [11.0, 10.5]);
    assert_eq!(rounded(1.26), [1.0, 1.3]);
    assert_eq!(rounded(0.94), [1.0, 1.0]);
}

#[test]
fn steps_that_make_no_sense_are_refused() {
    let trajectory = path(&[(10.0, 0.0, 0.0), (11.0, 7.0, 10.0)]);
    let by = Acceleration::Either;
    for step in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        for sampling in [
            Sampling::Time(step),
            Sampling::Distance(step),
            Sampling::Angle(step),
            Sampling::Dynamic { min: step, max: 1.0, by },
            Sampling::Dynamic { min: 0.1, max: step, by },
        ] {
            assert_eq!(refused(sampling, &trajectory), ResampleError::Step, "{sampling:?}");
        }
    }
    let longer = Sampling::Dynamic { min: 0.2, max: 0.1, by };
    assert_eq!(refused(longer, &trajectory), ResampleError::Step);
    assert_eq!(
        ResampleError::Step.to_string(),
        "steps must be above zero, and the shortest not longer than the longest"
    );
}

#[test]
fn a_program_has_32766_points_at_most() {
    // Joints are the same at all of them: the time alone continues.
    let rest = |seconds: f64| {
        let sample = |time| JointSample { time, joints: [0.0; 6] };
        Trajectory::new(vec![sample(0.0), sample(seconds)]).unwrap()
    };
    let every_second = Resampling::new(Sampling::Time(1.0));
    for seconds in [32_765.0, 32_765.25] {
        let (program, report) = make(&every_second, &rest(seconds));
        assert_eq!((program.positions.len(), report.moves), (32_766, 32_765));
    }
    assert_eq!(refused(Sampling::Time(1.0), &rest(32_765.5)), ResampleError::Points);
    assert_eq!(refused(Sampling::Time(1.0), &rest(32_766.0)), ResampleError::Points);
    assert_eq!(ResampleError::Points.to_string(), "the step is too short: more than 32766 points");
    let far = path(&[(0.0, 0.0, 0.0), (1.0, 70.0, 70.0)]);
    let dynamic = Sampling::Dynamic { min: 1e-5, max: 1e-5, by: Acceleration::Either };
    for sampling in [Sampling::Distance(1e-3), Sampling::Angle(1e-3), dynamic] {
        assert_eq!(refused(sampling, &far), ResampleError::Points, "{sampling:?}");
    }
}

#[test]
fn a_program_that_cannot_be_written_is_refused() {
    let trajectory = path(&[(10.0, 0.0, 0.0), (11.0, 7.0, 10.0)]);
    let made = Resampling::new(Sampling::Time(0.5)).program("1", "", &trajectory, &Plain, &Rules::default());
    assert_eq!(made.unwrap_err(), ResampleError::Encode(EncodeError::Name));
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
    assert!((second / first - 2.0).abs() < 0.25, "{first} s, {second} s");
}

/// Returns the position on a path from 0 to 100 mm/s at 125 mm/s², 1 s at that speed, and down again: the figures of the
/// source's summary.
fn trapezoid(t: f64) -> f64 {
    match t {
        t if t < 0.8 => 62.5 * t * t,
        t if t < 1.8 => 40.0 + 100.0 * (t - 0.8),
        t if t < 2.6 => 180.0 - 62.5 * (2.6 - t) * (2.6 - t),
        _ => 180.0,
    }
}

/// A table of rounded numbers moves the tool by steps of 10 µm: between 8 ms apart, that looks like 160 mm/s².
#[test]
fn the_last_decimal_of_a_table_is_no_acceleration() {
    let sampling = Resampling::new(Sampling::Dynamic { min: 0.05, max: 0.5, by: Acceleration::Either });
    let moves = |at: fn(f64) -> f64| {
        let samples = (0..=325).map(|k| f64::from(k) * 0.008).map(|time| (time, at(time), 0.0));
        make(&sampling, &path(&samples.collect::<Vec<_>>())).1.moves
    };
    let (exact, rounded) = (moves(trapezoid), moves(|t| (trapezoid(t) * 100.0).round() / 100.0));
    assert!(rounded.abs_diff(exact) <= 4, "{rounded} and {exact}");
}
