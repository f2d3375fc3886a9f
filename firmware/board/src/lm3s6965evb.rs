//! TI's evaluation board for the LM3S6965 (Cortex-M3), and QEMU's `lm3s6965evb`.

use core::time::Duration;

use ::cortex_m::peripheral::NVIC;
use lm3s6965::{Interrupt, interrupt};

use crate::cortex_m::{set_priorities, trigger_session};
use crate::register::registers;
use crate::systick::{self, CYCLE};
use crate::{Uart, uart};

pub(crate) const HZ: u32 = 12_500_000;
/// The system timer counts a whole second.
pub(crate) const PARTS: u32 = 1;
/// The second time that the watchdog has counted so far, 4 s after it was fed, it resets the board. An idle one is woken
/// every second.
const WATCHDOG: u32 = 2 * HZ;

registers!(0x400F_E000: RIS = 0x050, RCC = 0x060, RCGC0 = 0x100, RCGC1 = 0x104, RCGC2 = 0x108);
registers!(0x4000_4000: PORTA_AFSEL = 0x420, PORTA_DEN = 0x51C);
// The drives are enabled by pin PF0, which is the board's lamp.
registers!(0x4002_5000: PF0 = 0x004, PORTF_DIR = 0x400, PORTF_DEN = 0x51C);
registers!(0x4000_C000: DR = 0x00, RSR = 0x04, FR = 0x18, IBRD = 0x24, FBRD = 0x28, LCRH = 0x2C, CTL = 0x30, IM = 0x38, ICR = 0x44);
registers!(0x4003_0000: TIMER_CFG = 0x00, TIMER_MODE = 0x04, TIMER_CTL = 0x0C, TIMER_IMR = 0x18, TIMER_ICR = 0x24, TIMER_LOAD = 0x28);
registers!(0x4000_0000: WDT_LOAD = 0x00, WDT_CTL = 0x08);

/// Starts the board: its clock, the time, the UART at a rate, without parity, and the watchdog.
///
/// # Panics
/// If it is called twice.
pub fn init(baud: u32) -> Uart {
    let mut core = cortex_m::Peripherals::take().expect("the board is started once");
    run_from_pll();
    RCGC0.write(RCGC0.read() | 1 << 3); // the watchdog
    RCGC1.write(RCGC1.read() | 1 << 16 | 1); // TIMER0, UART0
    RCGC2.write(RCGC2.read() | 1 << 5 | 1); // ports F and A
    PORTF_DIR.write(1);
    PORTF_DEN.write(1);
    set_drives(false);

    systick::start(&mut core.SYST);
    set_priorities(&mut core.SCB);

    PORTA_AFSEL.write(0b11);
    PORTA_DEN.write(0b11);
    // In units of 1/64 of what a bit takes of 16 cycles.
    let divisor = (HZ * 4 + baud / 2) / baud;
    IBRD.write(divisor / 64);
    FBRD.write(divisor % 64);
    LCRH.write(0b11 << 5 | 1 << 4); // 8 bits, with the FIFO
    set_receiving(true);
    CTL.write(1 << 9 | 1 << 8 | 1); // both ways

    TIMER_CFG.write(0); // 32 bits
    TIMER_MODE.write(1); // once
    TIMER_IMR.write(1);

    // SAFETY: no critical section masks single interrupts.
    unsafe {
        NVIC::unmask(Interrupt::UART0);
        NVIC::unmask(Interrupt::TIMER_0A);
    }
    WDT_LOAD.write(WATCHDOG);
    WDT_CTL.write(0b11);
    Uart::new()
}

/// Runs the core from the crystal of 8 MHz: 400 MHz / 2 / 16.
fn run_from_pll() {
    RCC.write(0x078E_3AC0); // from the internal oscillator, as after a reset
    RCC.write(RCC.read() & !(0x1F << 6 | 0b11 << 4 | 1 << 13 | 1 << 12 | 1) | 0xE << 6);
    while RIS.read() & 1 << 6 == 0 {}
    RCC.write(RCC.read() & !(1 << 11) | 0xF << 23 | 1 << 22);
}

pub(crate) fn set_alarm(after: Duration) {
    TIMER_CTL.write(0);
    let cycles = after.as_secs() as u32 * HZ + after.subsec_nanos() / CYCLE;
    TIMER_LOAD.write(cycles + 1);
    TIMER_CTL.write(1);
}

pub(crate) fn clear_alarm() {
    TIMER_CTL.write(0);
}

pub(crate) fn receive() -> Option<u8> {
    (FR.read() & 1 << 4 == 0).then(|| DR.read() as u8)
}

pub(crate) fn set_receiving(on: bool) {
    // Received, or silent with bytes in the FIFO; and always sent.
    IM.write(if on { 1 << 4 | 1 << 6 | 1 << 5 } else { 1 << 5 });
}

pub(crate) fn take_overrun() -> bool {
    let has_overrun = RSR.read() & 1 << 3 != 0;
    if has_overrun {
        RSR.write(0);
    }
    has_overrun
}

pub(crate) fn send(byte: u8) -> bool {
    let has_room = FR.read() & 1 << 5 == 0;
    if has_room {
        DR.write(u32::from(byte));
    }
    has_room
}

pub(crate) fn feed() {
    WDT_LOAD.write(WATCHDOG);
}

pub(crate) fn set_drives(on: bool) {
    PF0.write(u32::from(on));
}

#[interrupt]
fn UART0() {
    ICR.write(1 << 5); // the others end when the FIFO is empty
    uart::interrupt();
}

#[interrupt]
fn TIMER_0A() {
    TIMER_ICR.write(1);
    trigger_session();
}
