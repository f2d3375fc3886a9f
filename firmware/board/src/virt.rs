//! QEMU's `virt` with a RISC-V of 32 bits: its timer, its UART (16550) and its interrupt controllers are those of many
//! chips. It has no watchdog, and no pin for the drives.

use core::time::Duration;

use riscv::interrupt::Interrupt;
use riscv::register::mie;
use riscv_rt::core_interrupt;

use crate::register::registers;
use crate::{Uart, uart};

pub use riscv_rt::entry;

/// The frequency of the timer in Hz, and the time of a tick in nanoseconds.
const HZ: u64 = 10_000_000;
const TICK: u32 = 100;
const UART_INTERRUPT: u32 = 10;

registers!(0x0200_0000: MSIP = 0x0000, MTIMECMP_LOW = 0x4000, MTIMECMP_HIGH = 0x4004, MTIME_LOW = 0xBFF8, MTIME_HIGH = 0xBFFC);
registers!(0x0C00_0000: PRIORITY_OF_UART = 0x28, ENABLE = 0x2000, THRESHOLD = 0x20_0000, CLAIM = 0x20_0004);
registers!(u8, 0x1000_0000: DATA = 0, IER = 1, FCR = 2, LCR = 3, LSR = 5, DIVISOR_LOW = 0, DIVISOR_HIGH = 1);
registers!(0x0010_0000: FINISHER = 0);

/// Starts the board: the UART at a rate, without parity, and the interrupts.
pub fn init(baud: u32) -> Uart {
    let divisor = 3_686_400 / 16 / baud;
    LCR.write(1 << 7);
    DIVISOR_LOW.write(divisor as u8);
    DIVISOR_HIGH.write((divisor >> 8) as u8);
    LCR.write(0b11); // 8 bits
    FCR.write(1);
    set_receiving(true);
    PRIORITY_OF_UART.write(1);
    ENABLE.write(1 << UART_INTERRUPT);
    THRESHOLD.write(0);
    clear_alarm();
    // SAFETY: everything that they work with is there.
    unsafe {
        mie::set_msoft();
        mie::set_mtimer();
        mie::set_mext();
        riscv::interrupt::enable();
    }
    Uart::new()
}

fn ticks() -> u64 {
    loop {
        let (high, low) = (MTIME_HIGH.read(), MTIME_LOW.read());
        if MTIME_HIGH.read() == high {
            return u64::from(high) << 32 | u64::from(low);
        }
    }
}

/// Returns the time since the board was started.
pub fn now() -> Duration {
    let ticks = ticks();
    Duration::new(ticks / HZ, (ticks % HZ) as u32 * TICK)
}

pub(crate) fn set_alarm(after: Duration) {
    compare(ticks() + after.as_secs() * HZ + u64::from(after.subsec_nanos() / TICK) + 1);
}

pub(crate) fn clear_alarm() {
    compare(u64::MAX);
}

fn compare(at: u64) {
    MTIMECMP_HIGH.write(u32::MAX); // never, in between
    MTIMECMP_LOW.write(at as u32);
    MTIMECMP_HIGH.write((at >> 32) as u32);
}

pub(crate) fn receive() -> Option<u8> {
    (LSR.read() & 1 != 0).then(|| DATA.read())
}

pub(crate) fn set_receiving(on: bool) {
    // Received, and sent.
    IER.write(if on { 0b11 } else { 0b10 });
}

/// Returns whether bytes were lost; reading the status clears it.
pub(crate) fn take_overrun() -> bool {
    LSR.read() & 1 << 1 != 0
}

pub(crate) fn send(byte: u8) -> bool {
    let has_room = LSR.read() & 1 << 5 != 0;
    if has_room {
        DATA.write(byte);
    }
    has_room
}

pub(crate) fn trigger_session() {
    MSIP.write(1);
}

pub(crate) fn wait_for_interrupt() {
    riscv::asm::wfi();
}

pub(crate) fn feed() {}

pub(crate) fn set_drives(_: bool) {}

pub(crate) fn reset() -> ! {
    FINISHER.write(0x7777);
    loop {
        riscv::asm::wfi();
    }
}

/// Handles the software interrupt. No interrupt interrupts another: bytes wait in the UART while the session works, 16 of
/// them.
#[core_interrupt(Interrupt::MachineSoft)]
fn machine_soft() {
    MSIP.write(0);
    crate::session::interrupt();
}

#[core_interrupt(Interrupt::MachineTimer)]
fn machine_timer() {
    clear_alarm();
    trigger_session();
}

#[core_interrupt(Interrupt::MachineExternal)]
fn machine_external() {
    let claimed = CLAIM.read();
    uart::interrupt();
    CLAIM.write(claimed);
}
