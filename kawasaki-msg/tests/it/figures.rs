//! Figures: job numbers, decimals, times and their means, budgets.

use core::time::Duration;

use kawasaki_msg::timing::{UNPACK_MAX, UNPACK_MEAN, WORK_CYCLE, packets, transfer_time};
use kawasaki_msg::{Decimal, Numbering, Times};

#[test]
fn the_mean_goes_over_the_last_twenty() {
    let mut times = Times::default();
    assert_eq!((times.last(), times.mean()), (None, None));
    times.record(Duration::from_millis(100));
    assert_eq!(times.mean(), Some(Duration::from_millis(100)));
    for _ in 0..19 {
        times.record(Duration::from_millis(20));
    }
    assert_eq!(times.mean(), Some(Duration::from_millis(24)));
    times.record(Duration::from_millis(20));
    assert_eq!(times.mean(), Some(Duration::from_millis(20)));
    assert_eq!((times.last(), times.count()), (Some(Duration::from_millis(20)), 21));
}

#[test]
fn batching_pays_in_proportion() {
    assert_eq!(packets(2000, 43, 4096), 22);
    assert_eq!(transfer_time(2000, 43, 4096), Duration::from_millis(704));
    assert_eq!(transfer_time(2000, 4096, 4096), Duration::from_secs(64));
    assert_eq!(packets(1, 5000, 4096), 0);
}

#[test]
fn the_means_are_those_of_the_appendix() {
    let unpack = [
        361_328, 117_188, 200_195, 219_727, 117_188, 117_188, 117_188, 180_664, 175_781, 576_172, 543_634,
        195_259, 598_612u64,
    ];
    let cycle = [
        107_983, 108_105, 108_008, 108_105, 108_203, 108_081, 108_008, 108_301, 107_983, 108_105, 108_008,
        108_081, 109_717u64,
    ];
    assert_eq!(UNPACK_MEAN.as_micros(), u128::from((unpack.iter().sum::<u64>() + 65) / 130));
    assert_eq!(UNPACK_MAX.as_micros(), u128::from(unpack.iter().max().unwrap() / 10));
    assert_eq!(WORK_CYCLE.as_micros(), u128::from((cycle.iter().sum::<u64>() + 6) / 13));
}

#[test]
fn numbers_wrap_and_counts_go_on() {
    let numbering = Numbering::new(5);
    let numbers: Vec<_> = (0..=11).map(|count| numbering.number(count)).collect();
    let expected = [None, Some(1), Some(2), Some(3), Some(4), Some(5)];
    assert_eq!(numbers[..6], expected);
    assert_eq!(numbers[6..], [1, 2, 3, 4, 5, 1].map(Some));
    assert_eq!(numbering.next(5), 1);
}

#[test]
fn a_number_is_as_far_ahead_as_its_count() {
    for max in [1, 2, 5, 9999] {
        let numbering = Numbering::new(max);
        for count in [0, 1, 4, 5, 6, 9998, 9999, 10_000] {
            for ahead in (0..u32::from(max)).step_by(1 + usize::from(max) / 7) {
                if let Some(number) = numbering.number(count + ahead) {
                    assert_eq!(numbering.ahead(count, number), ahead, "{max} {count} {ahead}");
                }
            }
        }
    }
}

fn units(value: f64, places: u8) -> Option<i32> {
    Decimal::nearest(value, places).map(|decimal| decimal.units)
}

#[test]
fn a_float_becomes_the_nearest_decimal_or_none() {
    assert_eq!(units(1.5, 0), Some(2));
    assert_eq!(units(-1.5, 0), Some(-2));
    assert_eq!(units(-0.0004, 3), Some(0));
    assert_eq!(units(2_147_483.647, 3), Some(i32::MAX));
    assert_eq!(units(2_147_483_647.4, 0), Some(i32::MAX));
    assert_eq!(units(2_147_483_647.5, 0), None);
    assert_eq!(units(-2_147_483_648.4, 0), Some(i32::MIN));
    assert_eq!(units(-2_147_483_648.5, 0), None);
    assert_eq!(units(1e300, 9), None);
    assert_eq!(units(f64::NAN, 3), None);
    assert_eq!(units(f64::NEG_INFINITY, 3), None);
    assert_eq!(units(1.0, 10), None);
}
