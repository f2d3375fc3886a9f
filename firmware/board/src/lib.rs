//! The board support of each end's firmware.
//!
//! - The bytes of the UART come and go by its interrupt, through two buffers: [`Uart`].
//! - The session runs in an interrupt of its own, below those of the UART and of the alarm, which trigger it: [`start`],
//!   [`wake`].
//! - The main loop is the motion task. It sleeps in [`idle`], which feeds the watchdog.
//! - A panic stops the motion, and the board begins again: `panic`.
//!
//! All that is unsafe is in `register`, and the entry of a fault.
#![no_std]

mod alarm;
#[cfg(feature = "lm3s6965evb")]
#[path = "lm3s6965evb.rs"]
mod chip;
#[cfg(feature = "microbit")]
#[path = "microbit.rs"]
mod chip;
#[cfg(feature = "mps2_an386")]
#[path = "mps2_an386.rs"]
mod chip;
#[cfg(feature = "virt")]
#[path = "virt.rs"]
mod chip;
#[cfg(target_arch = "arm")]
mod cortex_m;
#[cfg(feature = "embassy")]
mod embassy;
#[cfg(feature = "faults")]
mod faults;
mod latest;
mod panic;
mod register;
mod session;
#[cfg(any(feature = "lm3s6965evb", feature = "mps2_an386"))]
mod systick;
mod uart;

#[cfg(feature = "virt")]
pub use chip::entry;
pub use chip::init;
#[cfg(any(feature = "microbit", feature = "virt"))]
pub use chip::now;
#[cfg(target_arch = "arm")]
pub use cortex_m::entry;
#[cfg(feature = "embassy")]
pub use embassy::{EmbassyClock, Receiver, Sender, wait_or_second};
pub use latest::Latest;
pub use session::{Driver, Link, start, wake};
#[cfg(any(feature = "lm3s6965evb", feature = "mps2_an386"))]
pub use systick::now;
pub use uart::Uart;

#[cfg(feature = "virt")]
use chip as core_of;
#[cfg(target_arch = "arm")]
use cortex_m as core_of;

use core::time::Duration;

use defmt_semihosting as _;

/// Sleeps until the next interrupt, unless `has_work`: called when the main loop has nothing to do. Interrupts are
/// off between the check and the sleep, so no change by an interrupt is missed.
pub fn idle(has_work: impl FnOnce() -> bool) {
    chip::feed();
    #[cfg(feature = "faults")]
    faults::stand_still();
    critical_section::with(|_| {
        if !has_work() {
            core_of::wait_for_interrupt();
        }
    });
}

/// Feeds the watchdog, because the motion continues. [`idle`] feeds it, too.
pub fn is_alive() {
    chip::feed();
}

/// Passes time in the motion task: the watchdog is fed, the session continues.
pub fn pause(time: Duration) {
    let end = now() + time;
    alarm::set(|times| times.main = Some(end));
    while now() < end {
        idle(|| now() >= end);
    }
    alarm::set(|times| times.main = None);
}

/// Switches the drives of the motion on. A panic, a fault and a reset switch them off.
pub fn enable_drives() {
    chip::set_drives(true);
}

defmt::timestamp!("{=u64:us}", {
    let now = now();
    now.as_secs() * 1_000_000 + u64::from(now.subsec_micros())
});
