//! What goes wrong on purpose, to see what is reported: the UART loses bytes, and the motion task stands still.

use core::cell::Cell;
use core::time::Duration;

use critical_section::Mutex;

use crate::now;

/// So many bytes come for one that is lost.
const EVERY: u32 = 5003;
/// When the motion task stands still, and until when: less than the watchdog allows.
const STANDS_FROM: Duration = Duration::from_secs(1);
const STANDS_UNTIL: Duration = Duration::from_secs(2);

static RECEIVED: Mutex<Cell<u32>> = Mutex::new(Cell::new(0));

/// Whether the byte that has come is lost.
pub(crate) fn loses_byte() -> bool {
    critical_section::with(|cs| {
        let received = RECEIVED.borrow(cs);
        received.set(received.get() + 1);
        received.get().is_multiple_of(EVERY)
    })
}

/// Stands still in its time.
pub(crate) fn stand_still() {
    if (STANDS_FROM..STANDS_UNTIL).contains(&now()) {
        defmt::warn!("the motion stands still");
        while now() < STANDS_UNTIL {}
    }
}
