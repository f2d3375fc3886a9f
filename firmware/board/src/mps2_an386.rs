//! Arm's MPS2 board with a Cortex-M4F (AN386), and QEMU's `mps2-an386`.

use core::time::Duration;

use ::cortex_m::interrupt::InterruptNumber;
use ::cortex_m::peripheral::NVIC;
use cortex_m_rt::exception;

use crate::cortex_m::{set_priorities, trigger_session};
use crate::register::registers;
use crate::systick::{self, CYCLE};
use crate::{Uart, uart};

pub(crate) const HZ: u32 = 25_000_000;
/// The system timer counts half a second.
pub(crate) const PARTS: u32 = 2;
/// The second time that the watchdog has counted so far, 4 s after it was fed, it resets the board. An idle one is woken
/// more often.
const WATCHDOG: u32 = 2 * HZ;

registers!(0x4000_4000: DATA = 0x00, STATE = 0x04, CTRL = 0x08, INT = 0x0C, BAUD = 0x10);
registers!(0x4000_0000: TIMER_CTRL = 0x00, TIMER_VALUE = 0x04, TIMER_RELOAD = 0x08, TIMER_INT = 0x0C);
registers!(0x4000_8000: WDT_LOAD = 0x00, WDT_CTL = 0x08);
// The drives are enabled by the first of the board's lamps.
registers!(0x4002_8000: LEDS = 0x00);

const RX_FULL: u32 = 1 << 1;
const TX_FULL: u32 = 1;
const RX_OVERRUN: u32 = 1 << 3;
/// Both directions, with an interrupt after a sent byte.
const ON: u32 = 0b0111;
const RX_INTERRUPT: u32 = 1 << 3;

/// The board's interrupts that are used: no crate of it is kept.
#[derive(Clone, Copy)]
#[repr(u16)]
enum Interrupt {
    UartRx = 0,
    UartTx = 1,
    Timer0 = 8,
}

// SAFETY: they are the board's.
unsafe impl InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

/// Starts the board: the time, the UART at a rate, without parity, and the watchdog.
///
/// # Panics
/// If it is called twice.
pub fn init(baud: u32) -> Uart {
    let mut core = ::cortex_m::Peripherals::take().expect("the board is started once");
    set_drives(false);
    systick::start(&mut core.SYST);
    set_priorities(&mut core.SCB);
    BAUD.write(HZ / baud);
    CTRL.write(ON);
    set_receiving(true);
    // SAFETY: no critical section masks single interrupts.
    unsafe {
        NVIC::unmask(Interrupt::UartRx);
        NVIC::unmask(Interrupt::UartTx);
        NVIC::unmask(Interrupt::Timer0);
    }
    WDT_LOAD.write(WATCHDOG);
    WDT_CTL.write(0b11);
    Uart::new()
}

pub(crate) fn set_alarm(after: Duration) {
    let cycles = after.as_secs() as u32 * HZ + after.subsec_nanos() / CYCLE;
    TIMER_CTRL.write(0);
    TIMER_RELOAD.write(cycles + 1);
    TIMER_VALUE.write(cycles + 1);
    TIMER_CTRL.write(1 << 3 | 1);
}

pub(crate) fn clear_alarm() {
    TIMER_CTRL.write(0);
}

pub(crate) fn receive() -> Option<u8> {
    (STATE.read() & RX_FULL != 0).then(|| DATA.read() as u8)
}

pub(crate) fn set_receiving(on: bool) {
    let was_on = CTRL.read() & RX_INTERRUPT != 0;
    CTRL.write(if on { ON | RX_INTERRUPT } else { ON });
    // A byte that arrived while the interrupt was off does not raise one: pend it.
    if on && !was_on && STATE.read() & RX_FULL != 0 {
        NVIC::pend(Interrupt::UartRx);
    }
}

pub(crate) fn take_overrun() -> bool {
    let has_overrun = STATE.read() & RX_OVERRUN != 0;
    if has_overrun {
        STATE.write(RX_OVERRUN);
    }
    has_overrun
}

pub(crate) fn send(byte: u8) -> bool {
    let has_room = STATE.read() & TX_FULL == 0;
    if has_room {
        DATA.write(u32::from(byte));
    }
    has_room
}

pub(crate) fn feed() {
    WDT_LOAD.write(WATCHDOG);
}

pub(crate) fn set_drives(on: bool) {
    LEDS.write(u32::from(on));
}

/// Every interrupt of the board.
// SAFETY: it only calls safe functions.
#[exception]
unsafe fn DefaultHandler(number: i16) {
    if number == Interrupt::Timer0 as i16 {
        TIMER_CTRL.write(0); // once
        TIMER_INT.write(1);
        trigger_session();
    } else {
        INT.write(0b11);
        uart::interrupt();
    }
}
