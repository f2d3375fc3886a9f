//! The line instead of a UART, and the time instead of a timer.

use core::cell::{Cell, RefCell};
use core::time::Duration;

use critical_section::Mutex;
use heapless::Vec;

use crate::measure;

/// The longest transmission of an end.
pub(crate) const MAX_TRANSMISSION_LEN: usize = 4096;

static NOW: Mutex<Cell<Duration>> = Mutex::new(Cell::new(Duration::ZERO));
static ALARM: Mutex<Cell<Option<Duration>>> = Mutex::new(Cell::new(None));
static RECEIVED: Mutex<Cell<Option<u8>>> = Mutex::new(Cell::new(None));
static SENT: Mutex<RefCell<Vec<u8, MAX_TRANSMISSION_LEN>>> = Mutex::new(RefCell::new(Vec::new()));

/// Returns the time of the world.
pub fn now() -> Duration {
    critical_section::with(|cs| NOW.borrow(cs).get())
}

/// Sets the time.
pub(crate) fn set_now(time: Duration) {
    critical_section::with(|cs| NOW.borrow(cs).set(time));
}

pub(crate) fn set_alarm(after: Duration) {
    critical_section::with(|cs| ALARM.borrow(cs).set(Some(NOW.borrow(cs).get() + after)));
}

pub(crate) fn clear_alarm() {
    critical_section::with(|cs| ALARM.borrow(cs).set(None));
}

pub(crate) fn alarm() -> Option<Duration> {
    critical_section::with(|cs| ALARM.borrow(cs).get())
}

pub(crate) fn receive() -> Option<u8> {
    critical_section::with(|cs| RECEIVED.borrow(cs).take())
}

/// Receives a byte.
pub(crate) fn put(byte: u8) {
    critical_section::with(|cs| RECEIVED.borrow(cs).set(Some(byte)));
}

/// Returns whether the last byte waits for free space.
pub(crate) fn is_full() -> bool {
    critical_section::with(|cs| RECEIVED.borrow(cs).get().is_some())
}

pub(crate) fn set_receiving(_: bool) {}

pub(crate) fn take_overrun() -> bool {
    false
}

pub(crate) fn send(byte: u8) -> bool {
    measure::answers();
    critical_section::with(|cs| SENT.borrow_ref_mut(cs).push(byte).is_ok())
}

/// Appends the bytes sent since the last call to `behind`; returns their number.
pub(crate) fn take_sent(behind: &mut Vec<u8, MAX_TRANSMISSION_LEN>) -> usize {
    critical_section::with(|cs| {
        let mut sent = SENT.borrow_ref_mut(cs);
        behind.extend_from_slice(&sent).expect("the peer reads each answer");
        let length = sent.len();
        sent.clear();
        length
    })
}
