//! The common parts of all boards with a Cortex-M.

use ::cortex_m::peripheral::SCB;
use ::cortex_m::peripheral::scb::SystemHandler;
use cortex_m_rt::{ExceptionFrame, exception};

use crate::{chip, session};

pub use cortex_m_rt::entry;

/// Sets the priorities: the session is below the interrupts that trigger it, and above the main loop.
pub(crate) fn set_priorities(scb: &mut SCB) {
    // SAFETY: no critical section relies on priorities.
    unsafe { scb.set_priority(SystemHandler::PendSV, 0xFF) };
}

pub(crate) fn trigger_session() {
    SCB::set_pendsv();
}

pub(crate) fn wait_for_interrupt() {
    ::cortex_m::asm::wfi();
}

pub(crate) fn reset() -> ! {
    SCB::sys_reset()
}

#[exception]
fn PendSV() {
    session::interrupt();
}

/// A fault stops the motion, too.
// SAFETY: it only writes registers.
#[exception]
unsafe fn HardFault(_: &ExceptionFrame) -> ! {
    chip::set_drives(false);
    reset()
}
