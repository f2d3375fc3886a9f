//! The interrupt in which the session runs.

use core::cell::Cell;
use core::time::Duration;

use critical_section::Mutex;

use crate::{Uart, core_of, uart};

/// The loop of an end over the UART: reads `INPUT` bytes at once, and sends up to `OUT`.
pub type Driver<const INPUT: usize, const OUT: usize> =
    robot_session::embedded_io::Driver<Uart, fn() -> Duration, INPUT, OUT>;

/// The work in the interrupt of the session: most of it is `poll` of a [`Driver`].
pub trait Link: Send {
    /// Called when bytes have come or gone, at the returned time, or after a call of [`wake`]. Returns the latest
    /// time of the next call.
    fn poll(&mut self) -> Option<Duration>;
}

static LINK: Mutex<Cell<Option<&'static mut dyn Link>>> = Mutex::new(Cell::new(None));

/// Hands a session over to its interrupt.
pub fn start(link: &'static mut dyn Link) {
    critical_section::with(|cs| LINK.borrow(cs).set(Some(link)));
    wake();
}

/// Has the session check its inputs, such as a queue whose jobs were completed. May be called from anywhere.
pub fn wake() {
    core_of::trigger_session();
}

/// Handles the interrupt. It never interrupts itself, so a session that is not in its slot will be put back.
pub(crate) fn interrupt() {
    let lost = uart::take_lost();
    if lost > 0 {
        defmt::warn!("the UART has lost bytes, {} times", lost);
    }
    #[cfg(feature = "embassy")]
    crate::embassy::interrupt();
    if let Some(link) = critical_section::with(|cs| LINK.borrow(cs).take()) {
        let at = link.poll();
        crate::alarm::set(|times| times.session = at);
        critical_section::with(|cs| LINK.borrow(cs).set(Some(link)));
    }
}
