//! Comparisons whose outcome is known by hand: few states, whole numbers, a delay that is the same everywhere.

use cellwire_motion::{
    Bounds, Confidence, Delay, Deviation, Quaternion, State, Summary, compare, deviations, differentiate,
    fit_delay, moving,
};

/// Returns a state every 8 ms, given by `at` at its time.
fn states(count: u32, at: impl Fn(f64) -> State) -> Vec<State> {
    (0..count).map(|k| at(f64::from(k) * 0.008)).collect()
}

/// Returns a state on the way along X at 100 mm/s and about Z at 10°/s.
fn line(time: f64) -> State {
    State {
        velocity: [100.0, 0.0, 0.0],
        angular_velocity: [0.0, 0.0, 10.0],
        ..State::at(time, [100.0 * time, 0.0, 0.0], Quaternion::from_wpr([0.0, 0.0, 10.0 * time]))
    }
}

fn at_rest(time: f64) -> State {
    State::at(time, [0.0; 3], Quaternion::IDENTITY)
}

fn deviation(time: f64, [position, rotation, velocity, angular_velocity]: [[f64; 3]; 4]) -> Deviation {
    Deviation { time, position, rotation, velocity, angular_velocity }
}

/// Returns the states, each off by the same deviation.
fn off(states: &[State], by: [[f64; 3]; 4]) -> Vec<(Deviation, State)> {
    states.iter().map(|state| (deviation(state.time, by), *state)).collect()
}

fn is_all(Bounds { low, high }: Bounds, value: f64) -> bool {
    (low - value).abs() < 1e-9 && (high - value).abs() < 1e-9
}

const OFF: [[f64; 3]; 4] = [[3.0, 0.0, 4.0], [0.0, 5.0, 12.0], [2.0, 3.0, 6.0], [1.0, 4.0, 8.0]];

#[test]
fn a_summary_has_the_greatest_and_the_root_mean_square() {
    let less = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [1.0, 2.0, 2.0]];
    let summary: Summary = [OFF, less].map(|parts| deviation(0.0, parts)).into_iter().collect();
    assert_eq!(summary.count, 2);
    let found = [summary.position, summary.rotation, summary.velocity, summary.angular_velocity];
    for (figures, [most, least]) in found.into_iter().zip([[5.0, 1.0], [13.0, 1.0], [7.0, 1.0], [9.0, 3.0]]) {
        assert_eq!((figures.max, figures.rms), (most, f64::sqrt((most * most + least * least) / 2.0)));
    }
}

#[test]
fn a_state_moves_above_1_mm_or_a_fifth_of_a_degree_a_second() {
    let moves = |velocity, angular_velocity| moving(&State { velocity, angular_velocity, ..at_rest(0.0) });
    assert!(!moves([1.0, 0.0, 0.0], [0.2, 0.0, 0.0]));
    for axis in 0..3 {
        let along = |speed: f64| core::array::from_fn(|part| if part == axis { speed } else { 0.0 });
        assert!(moves(along(-1.01), [0.0; 3]), "along {axis}");
        assert!(moves([0.0; 3], along(0.21)), "about {axis}");
    }
}

#[test]
fn a_state_alone_at_its_time_has_no_speed() {
    let mut states = [at_rest(1.0), State { position: [5.0; 3], ..at_rest(1.0) }];
    let expected = states;
    differentiate(&mut states[..1]);
    differentiate(&mut states);
    assert_eq!(states, expected);
}

#[test]
fn a_motion_deviates_nowhere_from_itself_its_ends_included() {
    let states = states(100, line);
    let found: Vec<Deviation> = deviations(&states, &states, 0.0).collect();
    assert_eq!(found.len(), 100);
    for found in found {
        let parts = [found.position, found.rotation, found.velocity, found.angular_velocity];
        assert!(parts.as_flattened().iter().all(|part| part.abs() < 1e-9), "{found:?}");
    }
}

#[test]
fn a_state_is_compared_if_either_of_the_two_moves() {
    let (moved, resting) = (states(100, line), states(100, at_rest));
    for (reference, recording, compared) in
        [(&moved, &resting, 100), (&resting, &moved, 100), (&moved, &moved, 100), (&resting, &resting, 0)]
    {
        let (found, idle) = compare(reference, recording);
        assert_eq!((found.len(), idle), (compared, 100 - compared as u64));
    }
}

#[test]
fn a_turn_on_the_spot_shows_its_delay() {
    let turn = |time: f64| {
        let angle = 20.0 * (1.0 - (time.clamp(0.0, 4.0) / 4.0 * core::f64::consts::PI).cos());
        State::at(time, [0.0; 3], Quaternion::from_wpr([0.0, 0.0, angle]))
    };
    // The clocks may be far apart; only the length of the range counts.
    for (apart, range) in [(0.0, -0.5..=0.5), (0.0, 0.0..=0.5), (1e5, 1e5..=1e5 + 0.5)] {
        for delay in [0.0036, 0.04] {
            let mut reference = states(501, turn);
            let mut recording = states(601, |time| State { time: time + apart, ..turn(time - delay) });
            differentiate(&mut reference);
            differentiate(&mut recording);
            let Some(Delay::Found(found)) = fit_delay(&reference, &recording, range.clone(), 0.01) else {
                panic!("not found in {range:?}, delayed by {delay}")
            };
            assert!((found - apart - delay).abs() < 1e-4, "found {found}, delayed by {delay}");
        }
    }
}

#[test]
fn of_two_delays_that_fit_alike_the_first_is_found() {
    // Half way there at 0.5 s, and half way back at 1.5 s.
    let at = |time, x| State { velocity: [10.0, 0.0, 0.0], position: [x, 0.0, 0.0], ..at_rest(time) };
    let (reference, recording) = ([at(0.0, 0.0), at(1.0, 8.0), at(2.0, 0.0)], [at(5.0, 4.0)]);
    let Some(Delay::Found(found)) = fit_delay(&reference, &recording, 3.0..=5.0, 0.25) else { panic!() };
    assert!((found - 3.5).abs() < 1e-5, "{found}");
}

#[test]
fn a_step_of_minus_zero_is_none() {
    let states = states(10, line);
    assert_eq!(fit_delay(&states, &states, 0.0..=1.0, -0.0), None);
}

#[test]
fn what_is_off_alike_everywhere_has_no_uncertainty() {
    let found = Confidence::of(&off(&states(500, line), OFF)).unwrap();
    assert!(is_all(found.position, 5.0) && is_all(found.rotation, 13.0), "{found:?}");
    assert!(is_all(found.velocity, 7.0) && is_all(found.angular_velocity, 9.0), "{found:?}");
}

#[test]
fn a_delay_that_is_left_over_is_seen_in_position_and_rotation() {
    let late = |by: f64| [[-100.0 * by, 0.0, 0.0], [0.0, 0.0, -10.0 * by], [0.0; 3], [0.0; 3]];
    for by in [0.04, -0.01] {
        let found = Confidence::of(&off(&states(500, line), late(by))).unwrap();
        assert!(is_all(found.delay, by), "{found:?}");
    }
    // The rotation is more significant than the position, which is right: 10 × 0.4 of 100² + 10².
    let [_, rotation, ..] = late(0.04);
    let found = Confidence::of(&off(&states(500, line), [[0.0; 3], rotation, [0.0; 3], [0.0; 3]])).unwrap();
    assert!(is_all(found.delay, 4.0 / 10_100.0), "{found:?}");
    let found = Confidence::of(&off(&states(500, at_rest), OFF)).unwrap();
    assert_eq!(found.delay, Bounds { low: 0.0, high: 0.0 }, "at rest nothing is late");
}

#[test]
fn what_is_off_the_other_way_has_the_bounds_of_the_other_way() {
    let states = states(500, line);
    let mut rng = fastrand::Rng::with_seed(3);
    let ahead: Vec<f64> = states.iter().map(|_| rng.f64() - 0.3).collect();
    let bounds = |sign: f64| {
        let off = |(state, ahead): (&State, &f64)| {
            let by = [[sign * ahead, 0.0, 0.0], [0.0; 3], [0.0; 3], [0.0; 3]];
            (deviation(state.time, by), *state)
        };
        let compared: Vec<_> = states.iter().zip(&ahead).map(off).collect();
        Confidence::of(&compared).unwrap()
    };
    let (one, other) = (bounds(1.0), bounds(-1.0));
    assert!(one.delay.low < one.delay.high && one.delay.high < 0.0, "{one:?}");
    assert_eq!(other.delay, Bounds { low: -one.delay.high, high: -one.delay.low });
    assert_eq!(other.position, one.position);
}

#[test]
fn eight_blocks_have_bounds_and_seven_have_none() {
    // Of states every 8 ms, each 32nd begins a block of 0.25 s.
    let found = |blocks: u32| Confidence::of(&off(&states(32 * blocks, line), OFF));
    assert_eq!(Confidence::LEAST_BLOCKS, 8);
    assert!(found(8).is_some());
    assert_eq!(found(7), None);
}
