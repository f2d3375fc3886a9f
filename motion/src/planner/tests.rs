use super::*;

const HOME: [f64; 6] = [0.0, 0.0, 0.0, 0.0, -90.0, 0.0];

fn planner() -> Planner {
    Planner::new(Arm::LR_MATE_200ID, Limits::LR_MATE_200ID, HOME)
}

fn linear(planner: &Planner, x: f64, y: f64, blend: f64) -> Move {
    let home = planner.arm.forward(&HOME);
    let goal = Goal::Pose(Pose { position: [x, y, 200.0], ..home }, None);
    Move { goal, way: PathKind::Linear, pace: Pace::Path(100.0), ramp: 0.2, blend }
}

#[test]
fn a_line_is_straight_has_its_speed_and_stops_at_its_end() {
    let mut planner = planner();
    let first = linear(&planner, 400.0, 0.0, 0.0);
    let (_, end) = planner.add(0.0, &first).unwrap();
    let second = linear(&planner, 400.0, 150.0, 0.0);
    let (next, stop) = planner.add(end, &second).unwrap();
    assert!(
        (next - stop).abs() < 1e-12 && (stop - end - 1.7).abs() < 1e-9,
        "150 mm at 100 mm/s and the ramp"
    );
    let arm = planner.arm;
    let mut at = |time: f64| arm.forward(&planner.at(time)).position;
    for k in 0..=170 {
        let [x, _, z] = at(end + f64::from(k) * 0.01);
        assert!((x - 400.0).abs() < 1e-6 && (z - 200.0).abs() < 1e-6, "{k}: {x} {z}");
    }
    let mut planner = self::planner();
    planner.add(0.0, &first).unwrap();
    planner.add(end, &second).unwrap();
    let mut at = |time: f64| arm.forward(&planner.at(time)).position;
    let (a, b) = (at(end + 0.8), at(end + 0.9));
    assert!((b[1] - a[1] - 10.0).abs() < 1e-6, "100 mm/s in the middle");
    assert!((at(stop)[1] - 150.0).abs() < 1e-6);
}

#[test]
fn a_corner_is_rounded_the_more_the_less_the_next_motion_waits() {
    let corner = |blend: f64| {
        let mut planner = planner();
        let arm = planner.arm;
        let start = linear(&planner, 350.0, 0.0, 0.0);
        let (_, begin) = planner.add(0.0, &start).unwrap();
        let first = linear(&planner, 450.0, 0.0, blend);
        let (next, _) = planner.add(begin, &first).unwrap();
        let mut second = linear(&planner, 450.0, 100.0, 0.0);
        second.blend = 0.0;
        // A motion that is added later may not be known before it begins.
        let mut nearest = f64::MAX;
        let mut slowest = f64::MAX;
        let mut before: Option<[f64; 3]> = None;
        let mut time = begin;
        let mut added = None;
        while added.is_none_or(|end| time < end) {
            if added.is_none() && time >= next {
                added = Some(planner.add(next, &second).unwrap().1);
            }
            let [x, y, _] = arm.forward(&planner.at(time)).position;
            nearest = nearest.min((x - 450.0).hypot(y));
            if let (Some([bx, by, _]), true) = (before, time > begin + 0.3 && time < next + 0.5) {
                slowest = slowest.min((x - bx).hypot(y - by) / 0.004);
            }
            before = Some([x, y, 0.0]);
            time += 0.004;
        }
        let [x, y, _] = arm.forward(&planner.at(time + 1.0)).position;
        assert!((x - 450.0).abs() < 1e-6 && (y - 100.0).abs() < 1e-6, "it arrives");
        (nearest, slowest)
    };
    let (fine, slow_fine) = corner(0.0);
    let (half, slow_half) = corner(0.5);
    let (full, slow_full) = corner(1.0);
    assert!(fine < 0.1 && half > 0.2 && full > 2.0 * half, "{fine} {half} {full} mm from the corner");
    assert!(
        slow_fine < 5.0 && slow_half > slow_fine && slow_full > 65.0,
        "{slow_fine} {slow_half} {slow_full} mm/s"
    );
    // 100 mm/s, 0.2 s: the mean distance from the middle of both averages is 13/72 of 20 mm on each side, and 1/√2 of it away.
    assert!((full - 20.0 * 13.0 / 72.0 / 2f64.sqrt()).abs() < 0.05, "{full}");
}

#[test]
fn joints_arrive_together_and_the_slowest_one_decides() {
    let mut planner = planner();
    let goal = [90.0, 19.0, 0.0, 0.0, -90.0, 0.0];
    let motion = Move {
        goal: Goal::Joints(goal),
        way: PathKind::Joint,
        pace: Pace::Share(0.5),
        ramp: 0.1,
        blend: 0.0,
    };
    let (_, end) = planner.add(0.0, &motion).unwrap();
    assert!((end - 0.5).abs() < 1e-9, "90° at half of 450°/s, and the ramp: {end}");
    let middle = planner.at(end / 2.0);
    let half = [45.0, 9.5, 0.0, 0.0, -90.0, 0.0];
    assert!(middle.iter().zip(half).all(|(found, half)| (found - half).abs() < 1e-9), "{middle:?}");
    assert_eq!(planner.at(end), goal);
    let far = Move { goal: Goal::Joints([171.0, 0.0, 0.0, 0.0, 0.0, 0.0]), ..motion };
    assert_eq!(
        planner.add(end, &far).unwrap_err().to_string(),
        "J1 would be at 171.0°: its range is -170° to 170°"
    );
    let pose = Pose { position: [900.0, 0.0, 0.0], ..Pose::IDENTITY };
    let out = Move { goal: Goal::Pose(pose, None), ..motion };
    assert!(matches!(planner.add(end, &out), Err(MoveError::Unreachable { .. })));
}

#[test]
fn an_arc_goes_through_its_point() {
    let mut planner = planner();
    let home = planner.arm.forward(&HOME);
    let start = linear(&planner, 450.0, 0.0, 0.0);
    let (_, begin) = planner.add(0.0, &start).unwrap();
    // Around (400, 0): from 450 through (400, 50) to 350.
    let goal = Goal::Pose(Pose { position: [350.0, 0.0, 200.0], ..home }, None);
    let arc = Move { goal, way: PathKind::Arc([400.0, 50.0, 200.0]), ..start };
    let (_, end) = planner.add(begin, &arc).unwrap();
    let length = core::f64::consts::PI * 50.0;
    assert!((end - begin - length / 100.0 - 0.2).abs() < 0.01, "{}", end - begin);
    let arm = planner.arm;
    let mut highest: f64 = 0.0;
    for k in 0..=100 {
        let [x, y, _] = arm.forward(&planner.at(begin + (end - begin) * f64::from(k) / 100.0)).position;
        assert!(((x - 400.0).hypot(y) - 50.0).abs() < 1e-3, "{x} {y}");
        highest = highest.max(y);
    }
    assert!(highest > 49.9, "through the via point, not around the other side");
    let line = Move { goal, way: PathKind::Arc([450.0, 0.0, 200.0]), ..start };
    assert_eq!(planner.add(end, &line), Err(MoveError::Arc));
}

#[test]
fn a_short_motion_gets_its_speed_and_loses_it_in_its_time() {
    let mut planner = planner();
    let goal = Goal::Joints([0.5, 0.0, 0.0, 0.0, -90.0, 0.0]);
    let motion = Move { goal, way: PathKind::Joint, pace: Pace::Share(1.0), ramp: 0.2, blend: 0.0 };
    let (_, end) = planner.add(0.0, &motion).unwrap();
    let at: Vec<f64> = (0..=26).map(|n| planner.at(0.008 * f64::from(n))[0]).collect();
    let speeds: Vec<f64> = at.windows(2).map(|pair| (pair[1] - pair[0]) / 0.008).collect();
    let jumps = speeds.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(speeds[0], f64::max);
    assert!(jumps < 0.6 && speeds.iter().any(|speed| *speed > 3.5), "{jumps} {speeds:?}");
    assert!((end - 0.2).abs() < 0.002 && (at[26] - 0.5).abs() < 1e-9);
}

#[test]
fn a_tool_without_an_arm_goes_anywhere_and_stops_where_it_is_told() {
    let mut planner = planner();
    let far = linear(&planner, 9000.0, 0.0, 0.0);
    let refused = planner.add(0.0, &far).unwrap_err();
    assert!(matches!(refused, MoveError::Unreachable { .. }), "{refused}");
    assert!(!planner.goes_anywhere());
    let mut planner = planner.anywhere();
    assert!(planner.goes_anywhere());
    let from = planner.pose(0.0).position[0];
    let (_, end) = planner.add(0.0, &far).unwrap();
    assert!((end - (9000.0 - from).hypot(planner.pose(0.0).position[2] - 200.0) / 100.0 - 0.2).abs() < 0.01);
    planner.halt(10.0);
    let here = planner.pose(20.0).position[0];
    assert!((here - from - 990.0).abs() < 20.0, "{here} from {from}");
    let (_, end) = planner.add(20.0, &far).unwrap();
    assert!((planner.pose(end).position[0] - 9000.0).abs() < 1e-6);
}

#[test]
fn a_curve_begins_when_it_is_added() {
    let mut planner = planner();
    let goals =
        [10.0, 30.0].map(|degrees| (Goal::Joints([degrees, 0.0, 0.0, 0.0, -90.0, 0.0]), Pace::Time(1.0)));
    assert_eq!(planner.add_spline(5.0, &goals).unwrap(), [6.0, 7.0]);
    for (time, degrees) in [(5.0, 0.0), (6.0, 10.0), (7.0, 30.0), (8.0, 30.0)] {
        assert!((planner.at(time)[0] - degrees).abs() < 1e-9, "{time} s");
    }
}

/// Returns a tool without an arm at rest at this position at time 0.
fn tool_at(place: Pose) -> Planner {
    let mut planner = planner().anywhere();
    let there = Move { pace: Pace::Time(1.0), ..to(place, PathKind::Linear, Pace::Share(1.0)) };
    let (_, end) = planner.add(-2.0, &there).unwrap();
    is_at(planner.pose(end), place);
    planner
}

fn to(place: Pose, way: PathKind, pace: Pace) -> Move {
    Move { goal: Goal::Pose(place, None), way, pace, ramp: 0.2, blend: 0.0 }
}

fn is_at(found: Pose, place: Pose) {
    let turn = found.rotation_to(&place);
    assert!(found.distance(&place) < 1e-6 && dot(turn, turn) < 1e-12, "{found:?}, expected {place:?}");
}

/// A turn of 70 degrees about an axis that is not one of the frame's.
#[test]
fn in_the_middle_of_its_time_a_line_is_in_the_middle_of_its_way_and_of_its_turn() {
    let start = Pose { position: [30.0, -40.0, 50.0], ..rotation([10.0, -20.0, 30.0]) };
    let turned = |turn, position| Pose { position, orientation: rotation(turn).then(start).orientation };
    let middle = turned([10.0, 15.0, 30.0], [80.0, 10.0, -50.0]);
    let goal = turned([20.0, 30.0, 60.0], [130.0, 60.0, -150.0]); // 245 mm
    let paces = [
        (PathKind::Linear, Pace::Turn(35.0), 2.0),
        (PathKind::Linear, Pace::Path(1e6), 70.0 / FASTEST_TURN), // the turn takes longer than the way
        (PathKind::Linear, Pace::Path(100.0), 60_000f64.sqrt() / 100.0),
        (PathKind::Joint, Pace::Share(0.5), 70.0 / FASTEST_TURN / 0.5),
        (PathKind::Joint, Pace::Share(0.1), 70.0 / FASTEST_TURN / 0.1),
    ];
    for (way, pace, cruise) in paces {
        let mut planner = tool_at(start);
        let (_, end) = planner.add(0.0, &to(goal, way, pace)).unwrap();
        assert!((end - cruise - 0.2).abs() < 1e-9, "{pace:?}: {end} s");
        is_at(planner.pose(end / 2.0), middle);
        is_at(planner.pose(end), goal);
    }
}

/// From 0 to 200 degrees of a circle that is askew to every axis, and the other way around.
#[test]
fn an_arc_is_that_of_the_circle_through_its_points() {
    let place = |degrees: f64| {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        Pose::shift(
            100.0 + 40.0 * cosine - 40.0 * sine,
            -200.0 + 20.0 * cosine + 40.0 * sine,
            300.0 + 40.0 * cosine + 20.0 * sine,
        )
    };
    for way in [200.0, -160.0] {
        let mut planner = tool_at(place(0.0));
        let arc = to(place(200.0), PathKind::Arc(place(way / 4.0).position), Pace::Time(2.0));
        let (_, end) = planner.add(0.0, &arc).unwrap();
        for (time, share) in [(0.6, 0.25), (end / 2.0, 0.5), (end, 1.0)] {
            is_at(planner.pose(time), place(way * share));
        }
    }
}

/// "The three places of an arc are on one line": within a thousandth, for any size.
#[test]
fn an_arc_has_three_places_that_are_not_on_one_line() {
    let arc = |via: [f64; 3], [x, y, z]: [f64; 3]| {
        let goal = to(Pose::shift(x, y, z), PathKind::Arc(via), Pace::Time(1.0));
        let mut planner = tool_at(Pose::IDENTITY);
        let (_, end) = planner.add(0.0, &goal)?;
        is_at(planner.pose(end), Pose::shift(x, y, z));
        Ok(())
    };
    for size in [0.1, 1.0, 1000.0] {
        let goal = [2.0 * size, 0.0, 0.0];
        let bent = |share: f64| [size, 0.0, size * share];
        assert_eq!(arc(bent(0.002), goal), Ok(()), "{size} mm");
        assert_eq!(arc(bent(-0.002), goal), Ok(()), "{size} mm");
        for via in [bent(0.0005), bent(0.0), [0.0; 3], goal, goal.map(|part| -part)] {
            assert_eq!(arc(via, goal), Err(MoveError::Arc), "{size} mm, through {via:?}");
        }
    }
    // Two of them are the same place up to a micrometre, whether the arc would be a whole circle or begins with its point.
    let far = [1.0, 1.0, 0.0];
    for (near, expected) in [(0.0, Err(MoveError::Arc)), (0.000_9, Err(MoveError::Arc)), (0.001, Ok(()))] {
        assert_eq!(arc(far, [near, 0.0, 0.0]), expected, "ends {near} mm from its begin");
        assert_eq!(arc([near, 0.0, 0.0], far), expected, "its point is {near} mm from its begin");
    }
}

/// Every way that the arm can be folded there, with whole turns of J4, J5 and J6 more and fewer.
#[test]
fn a_place_that_says_how_the_arm_is_folded_has_those_joints() {
    let joints = [10.0, 20.0, -30.0, 40.0, -50.0, 25.0];
    let arm = Arm::LR_MATE_200ID;
    let pose = arm.forward(&joints);
    let folded: Vec<_> = arm.inverse(&pose, &HOME, 0.0).collect();
    assert_eq!(folded.len(), 8);
    for solution in folded {
        for turns in [[0, 0, 0], [1, -1, 0], [-1, 0, 1], [0, 1, -1]] {
            let goal = Goal::Pose(pose, Some((solution.posture, turns)));
            let motion = Move { goal, ..to(pose, PathKind::Joint, Pace::Time(1.0)) };
            let mut planner = Planner::new(arm, Limits::ANY, HOME);
            let (_, end) = planner.add(0.0, &motion).unwrap();
            let [j1, j2, j3, wrist @ ..] = solution.joints;
            let [j4, j5, j6] = [0, 1, 2].map(|at| wrist[at] + 360.0 * f64::from(turns[at]));
            let expected = [j1, j2, j3, j4, j5, j6];
            assert_eq!((planner.target(), planner.at(end)), (expected, expected), "{turns:?}");
        }
        // On a line the arm stays folded as it is.
        let mut planner = Planner::new(arm, Limits::ANY, joints);
        let goal = Goal::Pose(pose, Some((solution.posture, [1, 1, 1])));
        planner.add(0.0, &Move { goal, ..to(pose, PathKind::Linear, Pace::Time(1.0)) }).unwrap();
        assert!(planner.target().iter().zip(joints).all(|(a, b)| (a - b).abs() < 1e-6), "{solution:?}");
    }
}

/// 716 mm before J1: backwards the arm's reach is shorter.
#[test]
fn a_place_that_the_arm_does_not_reach_folded_so_is_refused() {
    let pose = Pose::shift(796.0, 0.0, 0.0).then(Arm::LR_MATE_200ID.flange_turn());
    let add = |front| {
        let goal = Goal::Pose(pose, Some((Posture { flip: false, up: true, front }, [0; 3])));
        Planner::new(Arm::LR_MATE_200ID, Limits::ANY, HOME)
            .add(0.0, &Move { goal, ..to(pose, PathKind::Joint, Pace::Time(1.0)) })
            .map(|_| ())
    };
    assert_eq!(add(true), Ok(()));
    assert_eq!(add(false), Err(MoveError::Unreachable { x: 796.0, y: 0.0, z: 0.0 }));
}

#[test]
fn a_tool_that_takes_the_place_of_another_is_where_the_flange_holds_it() {
    for mut planner in [planner(), planner().anywhere()] {
        let flange = planner.pose(0.0);
        for tool in [Pose::from_xyzwpr([10.0, -20.0, 150.0, 15.0, 30.0, -70.0]), Pose::shift(0.0, 0.0, 80.0)]
        {
            planner.set_tool(tool);
            is_at(planner.pose(0.0), flange.then(tool));
            assert_eq!(planner.target(), HOME);
        }
    }
}
