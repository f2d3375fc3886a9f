//! The motion from telemetry: orientation, time and speeds from blocks, errors against a reference.
#![allow(clippy::cast_possible_truncation, reason = "the controller's registers are of single precision")]

use core::time::Duration;

use cellwire_motion::{
    Confidence, Counts, Delay, Deviation, MotionSample, Observation, Quaternion, State, Summary, Tracker,
    compare, deviations, differentiate, fit_delay,
};
use fanuc_hmi_modbus::TelemetryBlock;
use proptest::prelude::*;

fn close<const N: usize>(found: [f64; N], expected: [f64; N], within: f64) {
    let far = found.iter().zip(expected).any(|(a, b)| (a - b).abs() > within || a.is_nan());
    assert!(!far, "found {found:?}, expected {expected:?}");
}

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

mod orientation {
    use super::*;

    /// Check values of the source's formula, before its flip.
    #[test]
    fn w_p_r_become_the_quaternion_of_figure_8() {
        let q = |wpr| Quaternion::from_wpr(wpr).to_array();
        close(q([10.0, 20.0, 30.0]), [0.951_548_5, 0.038_134_6, 0.189_307_9, 0.239_298_3], 5e-8);
        close(q([-120.0, 80.0, 170.0]), [-0.521_169_5, -0.377_991_1, -0.632_878_1, 0.430_081_7], 5e-8);
        close(q([180.0, 0.0, 45.0]), [0.0, 0.923_879_5, 0.382_683_4, 0.0], 5e-8);
    }

    #[test]
    fn the_turns_are_about_fixed_axes_x_first() {
        // W 90 takes Y to Z; R 90 then takes X to Y and leaves Z.
        let q = Quaternion::from_wpr([90.0, 0.0, 90.0]);
        close(q.rotate([0.0, 1.0, 0.0]), [0.0, 0.0, 1.0], 1e-15);
        close(q.rotate([1.0, 0.0, 0.0]), [0.0, 1.0, 0.0], 1e-15);
    }

    #[test]
    fn straight_up_and_down_r_is_0() {
        for (wpr, shown) in [
            ([10.0, 90.0, 30.0], [-20.0, 90.0, 0.0]),
            ([10.0, -90.0, 30.0], [40.0, -90.0, 0.0]),
            ([180.0, -90.0, 0.0], [180.0, -90.0, 0.0]),
        ] {
            let found = Quaternion::from_wpr(wpr).to_wpr();
            close([found[0].abs(), found[1], found[2]], [f64::abs(shown[0]), shown[1], shown[2]], 1e-6);
            assert_eq!(found[0] < 0.0, shown[0] < 0.0, "{wpr:?}");
        }
    }

    /// "20 °/s about Z".
    #[test]
    fn eulers_equations_give_the_angular_velocity_in_both_frames() {
        let pose = |t: f64| Quaternion::from_wpr([50.0, -30.0, 20.0 * t]);
        let (a, b) = (pose(1.0), pose(1.008));
        let mut rate = b.to_array();
        rate.iter_mut().zip(a.to_array()).for_each(|(b, a)| *b = (*b - a) / 0.008);
        close(b.angular_velocity_world(rate), [0.0, 0.0, 20.0], 1e-4);
        let in_tool = b.conjugate().rotate([0.0, 0.0, 20.0]);
        close(b.angular_velocity_body(rate), in_tool, 0.02);
    }

    #[test]
    fn rotation_vectors_name_axis_and_angle_the_shorter_way() {
        let vector = |wpr| Quaternion::from_wpr(wpr).rotation_vector();
        close(vector([0.0; 3]), [0.0; 3], 0.0);
        close(vector([0.0, 0.0, 1e-9]), [0.0, 0.0, 1e-9], 1e-20);
        close(vector([179.0, 0.0, 0.0]), [179.0, 0.0, 0.0], 1e-9);
        close(vector([181.0, 0.0, 0.0]), [-179.0, 0.0, 0.0], 1e-9);
        close(Quaternion::normalised([0.0; 4]).to_array(), [1.0, 0.0, 0.0, 0.0], 0.0);
    }

    proptest! {
        #[test]
        fn w_p_r_and_rotation_vectors_are_the_same_orientation(
            wpr in [-180.0..180.0f64, -180.0..180.0, -180.0..180.0]
        ) {
            let q = Quaternion::from_wpr(wpr);
            let again = Quaternion::from_wpr(q.to_wpr());
            prop_assert!(again.near(q).rotation_to(q).iter().all(|part| part.abs() < 2e-5));
            let again = Quaternion::from_rotation_vector(q.rotation_vector());
            prop_assert!(again.rotation_to(q).iter().all(|part| part.abs() < 1e-9));
        }
    }
}

mod tracker {
    use super::*;

    /// Creates a block as the source's background task does: Q1 positive, speeds over a fixed 8 ms.
    fn block(life_counter: u32, position: [f64; 3], wpr: [f64; 3], before: [f64; 3]) -> TelemetryBlock {
        let flipped = |wpr| {
            let q = Quaternion::from_wpr(wpr);
            let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
            q.to_array().map(|part| (part * sign) as f32)
        };
        let (quaternion, last) = (flipped(wpr), flipped(before));
        let mut quaternion_rate = quaternion;
        quaternion_rate.iter_mut().zip(last).for_each(|(q, last)| *q = (*q - last) / 0.008);
        let position = position.map(|part| part as f32);
        let wpr = wpr.map(|part| part as f32);
        TelemetryBlock { life_counter, position, wpr, quaternion, quaternion_rate, ..Default::default() }
    }

    fn sample(observation: Observation) -> MotionSample {
        let Observation::Sample(sample) = observation else { panic!("{observation:?}") };
        sample
    }

    /// Fig. 8, "Q1 > 0": from R 179.9° to 180.1° in 8 ms, 25 °/s, the source's task computes a speed of -250 /s.
    #[test]
    fn the_flip_near_180_degrees_makes_no_speed() {
        let mut tracker = Tracker::new();
        tracker.push(&block(1, [0.0; 3], [0.0, 0.0, 179.9], [0.0, 0.0, 179.7]));
        let jump = block(2, [0.0; 3], [0.0, 0.0, 180.1], [0.0, 0.0, 179.9]);
        assert!((f64::from(jump.quaternion_rate[3]) + 250.0).abs() < 0.01, "the source's: {jump:?}");
        let sample = sample(tracker.push(&jump));
        close(sample.quaternion_rate, [-0.218, 0.0, 0.0, 0.0], 0.001);
        close(sample.angular_velocity_world, [0.0, 0.0, 25.0], 0.01);
        // The sign stays as it follows from sample to sample, even if the flip does not come back.
        let next = block(3, [0.0; 3], [0.0, 0.0, 180.3], [0.0, 0.0, 180.1]);
        let Observation::Sample(next) = tracker.push(&next) else { panic!() };
        close(next.angular_velocity_world, [0.0, 0.0, 25.0], 0.01);
        assert!(next.orientation.w < 0.0);
    }

    #[test]
    fn gaps_divide_by_the_time_that_passed_and_doubles_are_no_samples() {
        let mut tracker = Tracker::new();
        let at = |counter: u32| {
            let t = f64::from(counter) * 0.008;
            block(counter, [100.0 * t, 0.0, -5.0 * t], [0.0, 20.0 * t, 0.0], [0.0; 3])
        };
        assert_eq!(tracker.push(&at(10)), Observation::First);
        for (counter, missed) in [(11, 0), (14, 2), (15, 0)] {
            let sample = sample(tracker.push(&at(counter)));
            assert_eq!((sample.missed, sample.time), (missed, ms(u64::from(counter - 10) * 8)));
            close(sample.velocity, [100.0, 0.0, -5.0], 0.01);
            close(sample.angular_velocity_world, [0.0, 20.0, 0.0], 0.01);
            assert_eq!(tracker.push(&at(counter)), Observation::Repeated);
        }
        let counts = Counts { samples: 3, repeated: 3, gaps: 1, missed: 2, restarts: 0 };
        assert_eq!(tracker.counts(), counts);
    }

    /// A block every 500 ms of a task that runs every 8 ms: 62 or 63 runs.
    #[test]
    fn runs_that_the_polling_interval_skips_are_not_missed() {
        let mut tracker = Tracker::with_polls(ms(8), ms(500));
        let mut counter = 0;
        tracker.push(&block(counter, [0.0; 3], [0.0; 3], [0.0; 3]));
        for (runs, missed) in [(62, 0), (63, 0), (1, 0), (94, 0), (95, 32), (125, 62)] {
            counter += runs;
            let sample = sample(tracker.push(&block(counter, [0.0; 3], [0.0; 3], [0.0; 3])));
            assert_eq!((sample.missed, sample.time), (missed, ms(u64::from(counter) * 8)), "{runs}");
        }
        assert_eq!((tracker.counts().gaps, tracker.counts().missed), (2, 94));
        let mut tracker = Tracker::with_polls(ms(8), ms(16));
        let mut push = |counter| tracker.push(&block(counter, [0.0; 3], [0.0; 3], [0.0; 3]));
        push(0);
        assert_eq!(
            [3, 7].map(|counter| sample(push(counter)).missed),
            [0, 2],
            "half an interval late, and a whole one"
        );
    }

    /// 198.8 days at 125 Hz to the sign, twice that to zero.
    #[test]
    fn the_life_counter_wraps() {
        for (from, to, missed) in [(u32::MAX, 0, 0), (u32::MAX - 1, 2, 3), (i32::MAX as u32, 1 << 31, 0)] {
            let mut tracker = Tracker::new();
            tracker.push(&block(from, [0.0; 3], [0.0; 3], [0.0; 3]));
            let sample = sample(tracker.push(&block(to, [0.8, 0.0, 0.0], [0.0; 3], [0.0; 3])));
            assert_eq!(sample.missed, missed);
            close(sample.velocity, [100.0 / f64::from(missed + 1), 0.0, 0.0], 1e-4);
        }
    }

    #[test]
    fn a_counter_that_goes_back_begins_anew() {
        let mut tracker = Tracker::with_period(ms(4));
        let block = |counter, x| block(counter, [x, 0.0, 0.0], [0.0; 3], [0.0; 3]);
        tracker.push(&block(5000, 0.0));
        assert_eq!(tracker.push(&block(3, 900.0)), Observation::Restarted);
        let sample = sample(tracker.push(&block(4, 900.4)));
        close(sample.velocity, [100.0, 0.0, 0.0], 0.01);
        assert_eq!(sample.time, ms(4));
        assert_eq!(tracker.counts().restarts, 1);
    }

    #[test]
    fn the_tools_frame_turns_with_the_tool() {
        let mut tracker = Tracker::new();
        let at = |counter: u32, w| block(counter, [0.0; 3], [w, 0.0, 90.0], [0.0; 3]);
        tracker.push(&at(1, 0.0));
        // W turns about the world's X first, R then carries that axis to Y: about Y in the world, about X in the tool.
        let sample = sample(tracker.push(&at(2, 0.16)));
        close(sample.angular_velocity_world, [0.0, 20.0, 0.0], 0.01);
        close(sample.angular_velocity_body, [20.0, 0.0, 0.0], 0.01);
    }
}

mod evaluate {
    use super::*;

    /// Returns a point of an S-curve in X with a turn, at rest at both ends.
    fn pose(t: f64) -> ([f64; 3], Quaternion) {
        let s = (t.clamp(0.0, 4.0) / 4.0 * core::f64::consts::PI).cos();
        ([200.0 * (1.0 - s), 30.0, 400.0], Quaternion::from_wpr([180.0, 0.0, 20.0 * (1.0 - s)]))
    }

    fn motion(seconds: f64, step: f64, delay: f64, shift: f64) -> Vec<State> {
        let state = |k: u32| {
            let time = f64::from(k) * step;
            let ([x, y, z], orientation) = pose(time - delay);
            State::at(time, [x, y + shift, z], orientation)
        };
        let mut states: Vec<State> = (0..).map(state).take_while(|s| s.time <= seconds).collect();
        differentiate(&mut states);
        states
    }

    #[test]
    fn the_delay_is_found_and_what_is_left_is_the_error() {
        for delay in [0.0, 0.04, 0.0363, 0.31] {
            let (reference, recording) = (motion(4.0, 0.008, 0.0, 0.0), motion(4.8, 0.008, delay, 1.5));
            let Some(Delay::Found(found)) = fit_delay(&reference, &recording, -0.5..=0.5, 0.01) else {
                panic!("not found, delayed by {delay}")
            };
            assert!((found - delay).abs() < 1e-4, "found {found}, delayed by {delay}");
            let summary: Summary = deviations(&reference, &recording, found).collect();
            close([summary.position.max, summary.position.rms], [1.5, 1.5], 0.01);
            assert!(summary.rotation.max < 0.001 && summary.velocity.rms < 0.05, "{summary:?}");
            // At the two ends the acceleration jumps: 62 mm/s² within one sample of 8 ms.
            assert!(summary.velocity.max < 0.5, "{summary:?}");
            assert_eq!(summary.count, 601);
        }
    }

    #[test]
    fn a_delay_beyond_the_search_is_not_found() {
        for delay in [0.7, -0.7] {
            let reference = motion(4.0, 0.008, 1.0, 0.0);
            let recording = motion(6.0, 0.008, 1.0 + delay, 0.0);
            let found = fit_delay(&reference, &recording, -0.5..=0.5, 0.01).unwrap();
            let Delay::AtBorder(at) = found else { panic!("{found:?}") };
            assert!((at - delay.signum() * 0.5).abs() < 1e-4, "{at}");
        }
        let still: Vec<State> =
            (0..500).map(|k| State { time: f64::from(k) * 0.008, ..motion(1.0, 0.5, 9.0, 0.0)[0] }).collect();
        assert_eq!(fit_delay(&motion(4.0, 0.008, 0.0, 0.0), &still, -0.5..=0.5, 0.01), None, "nothing moves");
    }

    #[test]
    fn idle_time_counts_for_nothing() {
        // The motion lasts from 2 s to 6 s, the recording from 0 to 20 s, and it is off by 1.5 mm while it moves.
        let moved = |seconds: f64, shift: f64| {
            let mut states = motion(seconds, 0.008, 2.0, 0.0);
            let shifted = |state: &mut State| {
                if (2.0..=6.0).contains(&state.time) {
                    state.position[1] +=
                        shift * ((state.time - 2.0) / 4.0 * core::f64::consts::PI).sin().sqrt();
                }
            };
            states.iter_mut().for_each(shifted);
            states
        };
        let (compared, idle) = compare(&moved(8.0, 0.0), &moved(20.0, 1.5));
        let summary: Summary = compared.iter().map(|(deviation, _)| *deviation).collect();
        assert!((480..=501).contains(&summary.count), "{summary:?}");
        assert_eq!(summary.count + idle, 2501);
        // The mean of a sine's half wave is 2/π; over all 20 s it would be less than half as much.
        assert!(
            (summary.position.rms - 1.5 * (2.0 / core::f64::consts::PI).sqrt()).abs() < 0.02,
            "{summary:?}"
        );
    }

    #[test]
    fn the_bounds_hold_what_other_stretches_give() {
        // A robot that is off by a random walk of its own: 60 of them, each with bounds from itself alone.
        let reference = motion(4.0, 0.008, 0.0, 0.0);
        let mut rng = fastrand::Rng::with_seed(7);
        let mut noise = || (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0;
        let mut held = 0;
        for _ in 0..60 {
            let mut off = 0.0;
            let mut recording = reference.clone();
            for state in &mut recording {
                off = 0.7 * off + 0.1 * noise();
                state.position[0] += off;
            }
            let Some(Delay::Found(delay)) = fit_delay(&reference, &recording, -0.2..=0.2, 0.01) else {
                panic!()
            };
            recording.iter_mut().for_each(|state| state.time -= delay);
            let bounds = Confidence::of(&compare(&reference, &recording).0).unwrap().delay;
            assert!(bounds.high - bounds.low < 0.002, "{bounds:?}");
            held += u32::from(delay + bounds.low <= 0.0 && 0.0 <= delay + bounds.high);
        }
        // 95 % are meant; of 16 blocks a bootstrap holds a little less.
        assert!((50..60).contains(&held), "{held} of 60");
        assert_eq!(Confidence::of(&compare(&reference[..100], &reference).0), None, "too short to say");
    }

    /// The source's figures: 100 mm/s and 40 ms make the 4 mm that it measured.
    #[test]
    fn without_the_fit_a_delay_looks_like_an_error() {
        let line = |delay: f64| -> Vec<State> {
            let state = |k: u32| {
                let time = f64::from(k) * 0.008;
                State::at(time, [100.0 * (time - delay), 0.0, 0.0], Quaternion::IDENTITY)
            };
            (0..500).map(state).collect()
        };
        let middle = |delay| {
            let (reference, recording) = (line(0.0), line(0.04));
            deviations(&reference, &recording, delay).nth(250).unwrap().position
        };
        close(middle(0.0), [-4.0, 0.0, 0.0], 1e-9);
        close(middle(0.04), [0.0; 3], 1e-9);
    }

    #[test]
    fn speeds_are_neither_early_nor_late() {
        let states = motion(4.0, 0.008, 0.0, 0.0);
        let rate = |t: f64| 50.0 * core::f64::consts::PI * (t / 4.0 * core::f64::consts::PI).sin();
        for state in &states[1..states.len() - 1] {
            close(state.velocity, [rate(state.time), 0.0, 0.0], 0.01);
            close(state.angular_velocity, [0.0, 0.0, rate(state.time) / 10.0], 0.001);
        }
    }

    #[test]
    fn the_rotation_is_from_what_was_asked_for_to_what_was_recorded() {
        let state = |r| [State::at(0.0, [0.0; 3], Quaternion::from_wpr([0.0, 0.0, r]))];
        let Deviation { rotation, .. } = deviations(&state(10.0), &state(10.5), 0.0).next().unwrap();
        close(rotation, [0.0, 0.0, 0.5], 1e-9);
        let Deviation { rotation, .. } = deviations(&state(179.9), &state(-179.9), 0.0).next().unwrap();
        close(rotation, [0.0, 0.0, 0.2], 1e-9);
    }

    #[test]
    fn what_cannot_be_compared_gives_nothing() {
        let states = motion(1.0, 0.008, 0.0, 0.0);
        assert_eq!(fit_delay(&[], &states, 0.0..=1.0, 0.1), None);
        assert_eq!(fit_delay(&states, &[], 0.0..=1.0, 0.1), None);
        assert_eq!(deviations(&[], &states, 0.0).count(), 0);
        #[allow(clippy::reversed_empty_ranges, reason = "that is the case")]
        for (range, step) in
            [(1.0..=0.0, 0.1), (0.0..=1.0, 0.0), (0.0..=1.0, 1e-9), (0.0..=f64::INFINITY, 0.1)]
        {
            assert_eq!(fit_delay(&states, &states, range, step), None);
        }
        assert_eq!(fit_delay(&states, &states, f64::NAN..=1.0, 0.1), None);
        assert_eq!(Summary::from_iter([]), Summary::default());
    }
}
