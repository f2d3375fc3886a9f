//! What goes wrong stops the motion.

use core::panic::PanicInfo;

use crate::{chip, core_of};

/// Stops the motion, says why, and begins again.
#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    chip::set_drives(false);
    defmt::error!("{}", defmt::Display2Format(info));
    core_of::reset()
}
