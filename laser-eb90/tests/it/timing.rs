//! The times of the line and of the controller's cycle.

use core::time::Duration;

use laser_eb90::timing::{TICK, end_of_tick, exchange_time, period, transmission_time};

use crate::common::MS;

#[test]
fn a_cycle_ends_at_its_multiples() {
    let end = |micros| end_of_tick(Duration::from_micros(micros), TICK).as_micros();
    assert_eq!([0, 1, 15_999, 16_000, 16_001].map(end), [0, 16_000, 16_000, 16_000, 32_000]);
    assert_eq!(end_of_tick(MS, Duration::ZERO), MS);
}

#[test]
fn an_exchange_is_both_frames_on_the_line_and_a_cycle() {
    assert_eq!(transmission_time(217, 9600).as_micros(), 226_041);
    assert_eq!(transmission_time(1, 0), Duration::MAX);
    assert_eq!(exchange_time(217, 11, 9600, TICK).as_micros(), 253_500);
    // An instruction of 30 bytes at 9600 baud: 64 ms alone, 240 ms for seven.
    assert_eq!(period(37, 11, 9600, TICK), MS * 64);
    assert_eq!(period(217, 11, 9600, TICK), MS * 240);
}
