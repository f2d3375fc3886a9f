//! The C library.

use core::ffi::{c_char, c_int};

#[link(name = "c")]
unsafe extern "C" {
    fn abort() -> !;
    fn printf(format: *const c_char, ...) -> c_int;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: `abort` takes nothing and does not return.
    unsafe { abort() }
}

/// Prints how many bytes something takes.
pub fn print_size<T>(_: &T) -> i32 {
    // SAFETY: the format has one argument, of the type that it names.
    unsafe { printf(c"%zu\n".as_ptr(), size_of::<T>()) };
    0
}
