//! The board of `board`, as the programs of `ends` see it, with a peer in memory at the other end of the UART and a time
//! that passes only when everything has been done: counts the instructions from the last byte of a request to the first byte
//! of its answer.
//!
//! Each byte has an interrupt of its own, after the time that it takes on the line. All but the registers of a board's UART
//! and timer is the programs' and `board`'s own: the buffers, the interrupt of the session, the alarm.
#![no_std]

#[path = "../../board/src/alarm.rs"]
mod alarm;
mod chip;
#[cfg_attr(target_arch = "arm", path = "cortex_m.rs")]
#[cfg_attr(target_arch = "riscv32", path = "riscv.rs")]
mod core_of;
#[path = "../../board/src/latest.rs"]
mod latest;
mod measure;
mod peer;
#[path = "../../board/src/session.rs"]
mod session;
#[path = "../../board/src/uart.rs"]
mod uart;
mod world;

pub use chip::now;
pub use core_of::entry;
pub use latest::Latest;
pub use session::{Driver, Link, start, wake};
pub use uart::Uart;

use core::panic::PanicInfo;
use core::time::Duration;

use defmt_semihosting as _;

/// Starts the line at this rate.
pub fn init(baud: u32) -> Uart {
    core_of::init();
    world::start(baud);
    Uart::new()
}

/// Runs the next step of the world: called when the main loop has nothing to do.
pub fn idle(has_work: impl FnOnce() -> bool) {
    if !has_work() {
        world::step();
    }
}

/// Called when the motion continues.
pub fn is_alive() {
    world::step();
}

/// Passes time in the motion task.
pub fn pause(time: Duration) {
    let end = now() + time;
    alarm::set(|times| times.main = Some(end));
    while now() < end {
        world::step();
    }
    alarm::set(|times| times.main = None);
}

/// Does nothing: there are no drives.
pub fn enable_drives() {}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    semihosting::println!("{info}");
    semihosting::process::exit(1)
}
