//! TI's evaluation board for the LM3S6965 (Cortex-M3), and QEMU's `lm3s6965evb`.

use core::cell::Cell;
use core::time::Duration;

use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{NVIC, SCB, SYST};
use cortex_m_rt::{ExceptionFrame, exception};
use critical_section::Mutex;
use lm3s6965::{Interrupt, interrupt};

use crate::register::registers;
use crate::{Uart, session, uart};

/// A cycle of the processor is 80 ns, and so the counter of the system timer, of 24 bits, counts a whole second.
const HZ: u32 = 12_500_000;
const NANOS: u32 = 1_000_000_000 / HZ;
/// The second time that the watchdog has counted so far, 4 s after it was fed, it resets the board. An idle one is woken every second.
const WATCHDOG: u32 = 2 * HZ;

registers!(0x400F_E000: RIS = 0x050, RCC = 0x060, RCGC0 = 0x100, RCGC1 = 0x104, RCGC2 = 0x108);
registers!(0x4000_4000: PORTA_AFSEL = 0x420, PORTA_DEN = 0x51C);
// The drives are enabled by pin PF0, which is the board's lamp.
registers!(0x4002_5000: PF0 = 0x004, PORTF_DIR = 0x400, PORTF_DEN = 0x51C);
registers!(0x4000_C000: DR = 0x00, RSR = 0x04, FR = 0x18, IBRD = 0x24, FBRD = 0x28, LCRH = 0x2C, CTL = 0x30, IM = 0x38, ICR = 0x44);
registers!(0x4003_0000: TIMER_CFG = 0x00, TIMER_MODE = 0x04, TIMER_CTL = 0x0C, TIMER_IMR = 0x18, TIMER_ICR = 0x24, TIMER_LOAD = 0x28);
registers!(0x4000_0000: WDT_LOAD = 0x00, WDT_CTL = 0x08);

/// How often the system timer has begun anew: the seconds.
static SECONDS: Mutex<Cell<u32>> = Mutex::new(Cell::new(0));

/// Starts the board: its clock, the time, the UART at a rate, without parity, and the watchdog.
///
/// # Panics
/// When it is called twice.
pub fn init(baud: u32) -> Uart {
    let mut core = cortex_m::Peripherals::take().expect("the board is started once");
    run_from_pll();
    RCGC0.modify(|clocks| clocks | 1 << 3); // the watchdog
    RCGC1.modify(|clocks| clocks | 1 << 16 | 1); // TIMER0, UART0
    RCGC2.modify(|clocks| clocks | 1 << 5 | 1); // ports F and A
    PORTF_DIR.write(1);
    PORTF_DEN.write(1);
    set_drives(false);

    core.SYST.set_clock_source(SystClkSource::Core);
    core.SYST.set_reload(HZ - 1);
    core.SYST.clear_current();
    core.SYST.enable_interrupt();
    core.SYST.enable_counter();

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

    // The session is below the interrupts that trigger it, above the main loop.
    // SAFETY: no critical section relies on priorities.
    unsafe {
        core.SCB.set_priority(SystemHandler::PendSV, 0xFF);
        NVIC::unmask(Interrupt::UART0);
        NVIC::unmask(Interrupt::TIMER_0A);
    }
    WDT_LOAD.write(WATCHDOG);
    WDT_CTL.write(0b11);
    Uart::new()
}

/// From the crystal of 8 MHz: 400 MHz / 2 / 16.
fn run_from_pll() {
    RCC.write(0x078E_3AC0); // from the internal oscillator, as after a reset
    RCC.modify(|rcc| rcc & !(0x1F << 6 | 0b11 << 4 | 1 << 13 | 1 << 12 | 1) | 0xE << 6);
    while RIS.read() & 1 << 6 == 0 {}
    RCC.modify(|rcc| rcc & !(1 << 11) | 0xF << 23 | 1 << 22);
}

/// The time since the board was started.
pub fn now() -> Duration {
    critical_section::with(|cs| {
        let mut seconds = SECONDS.borrow(cs).get();
        let mut left = SYST::get_current();
        if SCB::is_pendst_pending() {
            (seconds, left) = (seconds + 1, SYST::get_current());
        }
        Duration::new(u64::from(seconds), (HZ - left) % HZ * NANOS)
    })
}

pub(crate) fn set_alarm(after: Duration) {
    TIMER_CTL.write(0);
    let cycles = after.as_secs() as u32 * HZ + after.subsec_nanos() / NANOS;
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

pub(crate) fn trigger_session() {
    SCB::set_pendsv();
}

pub(crate) fn wait_for_interrupt() {
    cortex_m::asm::wfi();
}

pub(crate) fn feed() {
    WDT_LOAD.write(WATCHDOG);
}

pub(crate) fn set_drives(on: bool) {
    PF0.write(u32::from(on));
}

pub(crate) fn reset() -> ! {
    SCB::sys_reset()
}

#[exception]
fn SysTick() {
    critical_section::with(|cs| {
        let seconds = SECONDS.borrow(cs);
        seconds.set(seconds.get() + 1);
    });
}

#[exception]
fn PendSV() {
    session::interrupt();
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

/// A fault stops the motion, too.
// SAFETY: it only writes a register.
#[exception]
unsafe fn HardFault(_: &ExceptionFrame) -> ! {
    set_drives(false);
    reset()
}
