//! A Cortex-M: the system timer of the emulated board counts 40 ns, an instruction takes 64 ns (`-icount shift=6`).

use ::cortex_m::Peripherals;
use ::cortex_m::peripheral::syst::SystClkSource;
use ::cortex_m::peripheral::{SCB, SYST};
use cortex_m_rt::exception;

use crate::{measure, session};

pub use cortex_m_rt::entry;

/// A number of instructions, and the number of ticks that they take.
pub(crate) const TICKS: (u64, u64) = (40, 64);
const MAX_COUNT: u32 = (1 << 24) - 1;

pub(crate) fn init() {
    let mut timer = Peripherals::take().expect("the board is started once").SYST;
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(MAX_COUNT);
    timer.clear_current();
    timer.enable_counter();
}

pub(crate) fn ticks() -> u32 {
    SYST::get_current()
}

/// Returns the elapsed ticks: the counter counts down.
pub(crate) fn elapsed(since: u32) -> u32 {
    since.wrapping_sub(SYST::get_current()) & MAX_COUNT
}

pub(crate) fn trigger_session() {
    SCB::set_pendsv();
}

#[exception]
fn PendSV() {
    measure::interrupt(session::interrupt);
}
