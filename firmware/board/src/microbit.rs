//! The BBC micro:bit of the first version (nRF51822, Cortex-M0), and QEMU's `microbit`, which has no watchdog.
//!
//! The processor swaps nothing at once: `split_static` of the work queue does not exist, but a queue in a `StaticCell` does.

use core::cell::Cell;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;

use ::cortex_m::peripheral::NVIC;
use critical_section::Mutex;
use nrf51_pac::{Interrupt, interrupt};

use crate::cortex_m::{set_priorities, trigger_session};
use crate::register::registers;
use crate::{Uart, uart};

registers!(0x4000_0000: HFCLKSTART = 0x000, HFCLKSTARTED = 0x100);
registers!(0x4000_2000: STARTRX = 0x000, STARTTX = 0x008, RXDRDY = 0x108, TXDRDY = 0x11C, ERROR = 0x124, INTENSET = 0x304,
    INTENCLR = 0x308, ERRORSRC = 0x480, ENABLE = 0x500, PSELTXD = 0x50C, PSELRXD = 0x514, RXD = 0x518, TXD = 0x51C, BAUDRATE = 0x524);
registers!(0x4000_8000: START = 0x000, CAPTURE1 = 0x044, COMPARE0 = 0x140, COMPARE3 = 0x14C, SHORTS = 0x200, TIMER_INTENSET = 0x304,
    TIMER_INTENCLR = 0x308, BITMODE = 0x508, PRESCALER = 0x510, CC0 = 0x540, CC1 = 0x544, CC3 = 0x54C);
registers!(0x4001_0000: WDT_START = 0x000, CRV = 0x504, RREN = 0x508, RR0 = 0x600);
// The drives are enabled by pin 0 of the edge connector, P0.03.
registers!(0x5000_0000: OUTSET = 0x508, OUTCLR = 0x50C, DIRSET = 0x518);

const RX_INTERRUPT: u32 = 1 << 2;
const TX_INTERRUPT: u32 = 1 << 7;
const COMPARE0_INTERRUPT: u32 = 1 << 16;
const COMPARE3_INTERRUPT: u32 = 1 << 19;
const MICROS: u32 = 1_000_000;
const DRIVES: u32 = 1 << 3;

/// The timer counts the microseconds of a second, and its interrupt the seconds.
static SECONDS: Mutex<Cell<u32>> = Mutex::new(Cell::new(0));
/// A byte is on its way out.
static SENDS: AtomicBool = AtomicBool::new(false);

/// Starts the board: its clock, the time, the UART at a rate, without parity, and the watchdog.
///
/// # Panics
/// If it is called twice.
pub fn init(baud: u32) -> Uart {
    let mut core = ::cortex_m::Peripherals::take().expect("the board is started once");
    HFCLKSTART.write(1);
    while HFCLKSTARTED.read() == 0 {}
    DIRSET.write(DRIVES);
    set_drives(false);
    set_priorities(&mut core.SCB);

    BITMODE.write(3); // 32 bits
    PRESCALER.write(4); // 1 MHz
    CC3.write(MICROS);
    SHORTS.write(1 << 3); // restarts there
    TIMER_INTENSET.write(COMPARE3_INTERRUPT);
    START.write(1);

    PSELTXD.write(24);
    PSELRXD.write(25);
    BAUDRATE.write(((u64::from(baud) << 32) / 16_000_000) as u32 & !0xFFF);
    ENABLE.write(4);
    STARTRX.write(1);
    STARTTX.write(1);
    INTENSET.write(RX_INTERRUPT | TX_INTERRUPT);
    // SAFETY: no critical section masks single interrupts.
    unsafe {
        NVIC::unmask(Interrupt::UART0);
        NVIC::unmask(Interrupt::TIMER0);
    }
    CRV.write(4 * 32_768);
    RREN.write(1);
    WDT_START.write(1);
    Uart::new()
}

fn micros() -> u32 {
    CAPTURE1.write(1);
    CC1.read()
}

/// Returns the time since the board was started.
pub fn now() -> Duration {
    critical_section::with(|cs| {
        let (mut seconds, mut at) = (SECONDS.borrow(cs).get(), micros());
        if COMPARE3.read() != 0 {
            (seconds, at) = (seconds + 1, micros());
        }
        Duration::new(u64::from(seconds), at % MICROS * 1000)
    })
}

/// Sets the alarm. For a deadline after this second, the session is called at the end of the second, and returns the
/// deadline again.
pub(crate) fn set_alarm(after: Duration) {
    critical_section::with(|_| {
        let at = micros() + after.subsec_micros() + 1;
        if after >= Duration::from_secs(1) || at >= MICROS {
            return clear_alarm();
        }
        COMPARE0.write(0);
        CC0.write(at);
        TIMER_INTENSET.write(COMPARE0_INTERRUPT);
        if micros() >= at {
            trigger_session();
        }
    });
}

pub(crate) fn clear_alarm() {
    TIMER_INTENCLR.write(COMPARE0_INTERRUPT);
}

pub(crate) fn receive() -> Option<u8> {
    if RXDRDY.read() == 0 {
        return None;
    }
    RXDRDY.write(0);
    Some(RXD.read() as u8)
}

pub(crate) fn set_receiving(on: bool) {
    (if on { INTENSET } else { INTENCLR }).write(RX_INTERRUPT);
}

pub(crate) fn take_overrun() -> bool {
    let has_error = ERROR.read() != 0;
    if has_error {
        ERROR.write(0);
        ERRORSRC.write(ERRORSRC.read());
    }
    has_error
}

pub(crate) fn send(byte: u8) -> bool {
    if SENDS.load(Ordering::Relaxed) {
        return false;
    }
    SENDS.store(true, Ordering::Relaxed);
    TXD.write(u32::from(byte));
    true
}

pub(crate) fn feed() {
    RR0.write(0x6E52_4635);
}

pub(crate) fn set_drives(on: bool) {
    (if on { OUTSET } else { OUTCLR }).write(DRIVES);
}

#[interrupt]
fn UART0() {
    if TXDRDY.read() != 0 {
        TXDRDY.write(0);
        SENDS.store(false, Ordering::Relaxed);
    }
    uart::interrupt();
}

#[interrupt]
fn TIMER0() {
    if COMPARE3.read() != 0 {
        critical_section::with(|cs| {
            COMPARE3.write(0);
            let seconds = SECONDS.borrow(cs);
            seconds.set(seconds.get() + 1);
        });
    }
    COMPARE0.write(0);
    trigger_session();
}
