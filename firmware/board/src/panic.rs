//! The panic handler: switches the drives off, logs the panic and resets the board.

use core::panic::PanicInfo;

use crate::{chip, core_of};

/// Switches the drives off, logs the panic and resets the board.
#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    chip::set_drives(false);
    defmt::error!("{}", defmt::Display2Format(info));
    core_of::reset()
}
