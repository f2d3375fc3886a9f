//! What goes wrong stops the motion.

use core::panic::PanicInfo;

use crate::chip;

/// Stops the motion, says why, and begins again.
#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    chip::set_drives(false);
    defmt::error!("{}", defmt::Display2Format(info));
    chip::reset()
}
