//! Fault injection: the UART loses bytes, and the motion task stalls.

use core::cell::Cell;
use core::time::Duration;

use critical_section::Mutex;

use crate::now;

/// The number of bytes of which one is lost.
const EVERY: u32 = 5003;
/// The number of bytes after which the motion task stalls, and the time of the stall: less than the watchdog allows.
const STANDS_FROM: u32 = 100;
const STANDS_FOR: Duration = Duration::from_secs(1);

static RECEIVED: Mutex<Cell<u32>> = Mutex::new(Cell::new(0));
static HAS_STOOD: Mutex<Cell<bool>> = Mutex::new(Cell::new(false));

/// Returns whether the received byte is lost.
pub(crate) fn loses_byte() -> bool {
    critical_section::with(|cs| {
        let received = RECEIVED.borrow(cs);
        received.set(received.get() + 1);
        received.get().is_multiple_of(EVERY)
    })
}

/// Stalls once.
pub(crate) fn stand_still() {
    let is_time = critical_section::with(|cs| {
        RECEIVED.borrow(cs).get() >= STANDS_FROM && !HAS_STOOD.borrow(cs).replace(true)
    });
    if is_time {
        defmt::warn!("the motion stalls");
        let until = now() + STANDS_FOR;
        while now() < until {}
    }
}
