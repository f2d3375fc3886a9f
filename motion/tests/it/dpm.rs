//! Offsets for DYNAMIC PATH MODIFIER.

use core::time::Duration;

use cellwire_motion::dpm::{self, Axis, Config, Modifier};
use proptest::prelude::*;

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

fn has_gone(modifier: &Modifier, expected: f64) {
    let found = modifier.path()[0];
    assert!((found - expected).abs() < 1e-9, "{found} mm, expected {expected}");
}

fn x_only(axis: Axis) -> Modifier {
    Modifier::new(Config::new([Some(axis), None, None, None, None, None])).unwrap()
}

fn along_x(speed: f64) -> [f64; 6] {
    [speed, 9.0, 9.0, 9.0, 9.0, 9.0]
}

#[test]
fn no_motion_is_lost_to_rounding() {
    let mut modifier = x_only(Axis::new(0.001));
    let mut sum = 0i64;
    for k in 0..1000u64 {
        modifier.demand(ms(8 * k), along_x(1.2345)).unwrap();
        let offsets = modifier.next_period(ms(8 * k));
        assert_eq!(offsets.counts[1..], [0; 5], "an axis that is not modified");
        sum += i64::from(offsets.counts[0]);
    }
    assert_eq!(sum, 9876); // 1.2345 mm/s for 8 s
    has_gone(&modifier, 9.876);
}

#[test]
fn the_limit_a_period_is_fig_13s_25_mm_a_second() {
    for (mm_per_count, most) in [(0.001, 200), (0.0015, 133), (0.2, 1), (0.3, 0)] {
        let mut modifier = x_only(Axis { max_per_path: 1e6, ..Axis::new(mm_per_count) });
        modifier.demand(ms(0), along_x(-1000.0)).unwrap();
        for _ in 0..5 {
            let offsets = modifier.next_period(ms(0));
            assert_eq!((offsets.counts[0], offsets.limited[0]), (-most, true), "{mm_per_count}");
        }
        // Nothing was saved up meanwhile.
        modifier.demand(ms(0), along_x(0.0)).unwrap();
        let rest: i16 = (0..10).map(|_| modifier.next_period(ms(0)).counts[0]).sum();
        assert!(rest.abs() <= 1, "{mm_per_count}: {rest}");
    }
}

/// If the 16 bits are the limit per period, the counts beyond them are dropped as by any other limit.
#[test]
fn what_the_16_bits_hold_back_is_not_caught_up_with() {
    let mut modifier = x_only(Axis::new(1e-6));
    modifier.demand(ms(0), along_x(12.5)).unwrap(); // 100 000 counts a period
    let offsets = modifier.next_period(ms(0));
    assert_eq!((offsets.counts[0], offsets.limited[0]), (i16::MAX, true));
    modifier.demand(ms(0), along_x(0.0)).unwrap();
    assert_eq!([(); 3].map(|()| modifier.next_period(ms(0)).counts[0]), [0; 3]);
}

#[test]
fn a_speed_below_a_count_a_period_moves_the_robot_as_well() {
    let mut modifier = x_only(Axis::new(0.001));
    modifier.demand(ms(0), along_x(0.0375)).unwrap(); // 0.3 counts a period
    for _ in 0..100 {
        assert!(!modifier.next_period(ms(0)).at_path_limit[0]);
    }
    has_gone(&modifier, 0.030);
}

/// 0.3 / 0.1 is a little less than 3.
#[test]
fn a_limit_of_whole_counts_is_all_of_them() {
    let mut modifier = x_only(Axis { mm_per_count: 0.1, max_per_period: 0.3, max_per_path: 0.3 });
    modifier.demand(ms(0), along_x(1000.0)).unwrap();
    assert_eq!([(); 2].map(|()| modifier.next_period(ms(0)).counts[0]), [3, 0]);
}

/// "10.00 mm": at 25 mm/s, after 0.4 s.
#[test]
fn the_limit_a_path_is_reached_and_never_passed() {
    let mut modifier = x_only(Axis::new(0.001));
    modifier.demand(ms(0), along_x(25.0)).unwrap();
    let mut periods = 0;
    while modifier.next_period(ms(0)).counts[0] == 200 {
        periods += 1;
    }
    assert_eq!(periods, 50);
    has_gone(&modifier, 10.0);
    let offsets = modifier.next_period(ms(0));
    assert_eq!((offsets.counts[0], offsets.at_path_limit[0]), (0, true));
    // Back is free, and so is a new path.
    modifier.demand(ms(0), along_x(-25.0)).unwrap();
    assert_eq!(modifier.next_period(ms(0)).counts[0], -200);
    modifier.begin_path();
    modifier.demand(ms(0), along_x(25.0)).unwrap();
    assert_eq!(modifier.next_period(ms(0)).counts[0], 200);
    has_gone(&modifier, 0.2);
}

/// 0.2 mm of 0.3 are whole, then half of it is left.
#[test]
fn a_step_across_the_limit_a_path_ends_at_it_and_says_so() {
    for direction in [1, -1] {
        let mut modifier = x_only(Axis { max_per_path: 0.3, ..Axis::new(0.001) });
        modifier.demand(ms(0), along_x(25.0 * f64::from(direction))).unwrap();
        let steps = [(); 3].map(|()| modifier.next_period(ms(0)));
        let found = steps.map(|offsets| (offsets.counts[0] * direction, offsets.at_path_limit[0]));
        assert_eq!(found, [(200, false), (100, true), (0, true)]);
    }
}

#[test]
fn at_the_limit_a_path_less_than_a_count_goes_back_but_no_further() {
    for direction in [1.0, -1.0] {
        let mut modifier = x_only(Axis { max_per_path: 0.2, ..Axis::new(0.001) });
        modifier.demand(ms(0), along_x(25.0 * direction)).unwrap();
        modifier.next_period(ms(0));
        modifier.demand(ms(0), along_x(0.0375 * direction)).unwrap(); // 0.3 counts a period
        for _ in 0..10 {
            let offsets = modifier.next_period(ms(0));
            assert_eq!((offsets.counts[0], offsets.at_path_limit[0]), (0, true));
        }
        modifier.demand(ms(0), along_x(0.0)).unwrap();
        assert!(!modifier.next_period(ms(0)).at_path_limit[0], "nothing is held back");
        modifier.demand(ms(0), along_x(-0.0375 * direction)).unwrap();
        for _ in 0..100 {
            assert!(!modifier.next_period(ms(0)).at_path_limit[0]);
        }
        has_gone(&modifier, 0.170 * direction);
    }
}

#[test]
fn the_group_inputs_hold_16_bits() {
    let mut modifier = x_only(Axis { mm_per_count: 1e-6, max_per_period: 1.0, max_per_path: 1e9 });
    modifier.demand(ms(0), along_x(1000.0)).unwrap();
    let offsets = modifier.next_period(ms(0));
    assert_eq!((offsets.counts[0], offsets.limited[0]), (i16::MAX, true));
    modifier.demand(ms(0), along_x(-1000.0)).unwrap();
    assert_eq!(modifier.next_period(ms(0)).counts[0], -i16::MAX);
}

#[test]
fn a_source_that_falls_silent_gives_zero() {
    let mut modifier = x_only(Axis::new(0.001));
    assert!(modifier.next_period(ms(0)).lost, "there was never a demand");
    modifier.demand(ms(0), along_x(5.06)).unwrap();
    assert_eq!(modifier.next_period(ms(24)).counts[0], 40); // 40.48
    let silent = modifier.next_period(ms(25));
    assert_eq!((silent.counts, silent.lost), ([0; 6], true));
    modifier.demand(ms(32), along_x(5.06)).unwrap();
    // The 0.48 of before is gone: that motion was given up.
    assert_eq!(modifier.next_period(ms(32)).counts[0], 40);
    assert_eq!(modifier.next_period(ms(40)).counts[0], 41);
}

#[test]
fn what_makes_no_sense_is_refused_and_the_last_demand_grows_old() {
    let refused = |axis| Modifier::new(Config::new([None, Some(axis), None, None, None, None])).unwrap_err();
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(refused(Axis::new(bad)), dpm::Error::Axis { index: 1 });
        assert_eq!(refused(Axis { max_per_path: bad, ..Axis::new(1.0) }), dpm::Error::Axis { index: 1 });
        assert_eq!(refused(Axis { max_per_period: bad, ..Axis::new(1.0) }), dpm::Error::Axis { index: 1 });
    }
    let mut config = Config::new([None; 6]);
    config.period = Duration::ZERO;
    assert_eq!(Modifier::new(config).unwrap_err(), dpm::Error::Period);
    let mut modifier = x_only(Axis::new(0.001));
    modifier.demand(ms(0), along_x(1.0)).unwrap();
    let refused = modifier.demand(ms(20), [0.0, 0.0, f64::NAN, 0.0, 0.0, 0.0]).unwrap_err();
    assert_eq!(refused, dpm::Error::Speed { index: 2 });
    assert_eq!(refused.to_string(), "axis 2: the speed is not a finite number");
    assert_eq!(modifier.next_period(ms(20)).counts[0], 8);
    assert!(modifier.next_period(ms(30)).lost);
}

proptest! {
    /// Each period, each path and the sum stay within their limits, for any speeds.
    #[test]
    fn no_limit_is_ever_passed(
        speeds in prop::collection::vec(-1e6..1e6f64, 1..200),
        mm_per_count in 1e-7..1.0f64,
        max_per_period in 1e-3..10.0f64,
        max_per_path in 1e-3..100.0f64,
    ) {
        let mut modifier = x_only(Axis { mm_per_count, max_per_period, max_per_path });
        let mut path = 0.0;
        for speed in speeds {
            modifier.demand(ms(0), along_x(speed)).unwrap();
            let step = f64::from(modifier.next_period(ms(0)).counts[0]) * mm_per_count;
            path += step;
            prop_assert!(step.abs() <= max_per_period * 1.000_01);
            prop_assert!(path.abs() <= max_per_path * 1.000_01);
            prop_assert!((modifier.path()[0] - path).abs() < 1e-6);
        }
    }
}
