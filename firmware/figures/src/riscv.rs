//! A RISC-V: under `-icount shift=0` an instruction is a cycle.

use riscv::interrupt::Interrupt;
use riscv::register::{mcycle, mie};
use riscv_rt::core_interrupt;

use crate::{measure, session};

pub use riscv_rt::entry;

/// A number of instructions, and the number of ticks that they take.
pub(crate) const TICKS: (u64, u64) = (1, 1);

pub(crate) fn init() {
    // SAFETY: everything that it works with is there.
    unsafe {
        mie::set_msoft();
        riscv::interrupt::enable();
    }
}

pub(crate) fn ticks() -> u32 {
    mcycle::read() as u32
}

pub(crate) fn elapsed(since: u32) -> u32 {
    ticks().wrapping_sub(since)
}

fn set_software_interrupt(is_on: bool) {
    // SAFETY: QEMU's `virt` has the register of its software interrupt there.
    unsafe { (0x0200_0000 as *mut u32).write_volatile(is_on.into()) };
}

pub(crate) fn trigger_session() {
    set_software_interrupt(true);
}

#[core_interrupt(Interrupt::MachineSoft)]
fn machine_soft() {
    set_software_interrupt(false);
    measure::interrupt(session::interrupt);
}
