//! The time by the system timer of a Cortex-M, which has 24 bits.

use core::cell::Cell;
use core::time::Duration;

use ::cortex_m::peripheral::syst::SystClkSource;
use ::cortex_m::peripheral::{SCB, SYST};
use cortex_m_rt::exception;
use critical_section::Mutex;

use crate::chip::{HZ, PARTS};

/// The length of a cycle, in nanoseconds: a whole number.
pub(crate) const CYCLE: u32 = 1_000_000_000 / HZ;

/// The seconds, and the parts of the next one, that have passed.
static PASSED: Mutex<Cell<(u32, u32)>> = Mutex::new(Cell::new((0, 0)));

pub(crate) fn start(timer: &mut SYST) {
    const { assert!(HZ / PARTS * PARTS == HZ && HZ / PARTS <= 1 << 24 && 1_000_000_000 % HZ == 0) };
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(HZ / PARTS - 1);
    timer.clear_current();
    timer.enable_interrupt();
    timer.enable_counter();
}

const fn next((seconds, parts): (u32, u32)) -> (u32, u32) {
    if parts + 1 == PARTS { (seconds + 1, 0) } else { (seconds, parts + 1) }
}

/// Returns the time since the board was started: without a division, which takes a hundred cycles or more on most cores.
pub fn now() -> Duration {
    critical_section::with(|cs| {
        let mut passed = PASSED.borrow(cs).get();
        let mut left = SYST::get_current();
        if SCB::is_pendst_pending() {
            (passed, left) = (next(passed), SYST::get_current());
        }
        let (seconds, parts) = passed;
        let cycles = if left == 0 { 0 } else { HZ / PARTS - left };
        Duration::new(u64::from(seconds), (parts * (HZ / PARTS) + cycles) * CYCLE)
    })
}

#[exception]
fn SysTick() {
    critical_section::with(|cs| {
        let passed = PASSED.borrow(cs);
        passed.set(next(passed.get()));
    });
}
