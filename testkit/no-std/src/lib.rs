//! What every program needs: a panic handler, and the C library that starts it; and a board for those that show their size.
#![no_std]

use core::ffi::{c_char, c_int};
use core::hint::black_box;
use core::ops::ControlFlow;
use core::time::Duration;

use robot_session::{Session, settle};

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

/// What a board does with a session, of which the compiler may know nothing: bytes, time, a call of the user's, and everything that
/// comes out. Prints how many bytes the session takes.
pub fn run<S: Session, R>(
    session: &mut S,
    buffer: &mut [u8],
    call: impl FnOnce(&mut S, Duration) -> R,
) -> i32 {
    let now = black_box(Duration::ZERO);
    session.handle_connected(now);
    session.handle_input(now, black_box(&[]));
    session.handle_timeout(now);
    session.handle_transmitted(now);
    let _ = call(session, now);
    let _ = settle(session, now, buffer, |_, output| {
        black_box(output);
        ControlFlow::<()>::Continue(())
    });
    black_box(session.poll_timeout());
    session.handle_disconnected(now);
    print_size(session)
}

/// Prints how many bytes something takes.
pub fn print_size<T>(_: &T) -> i32 {
    // SAFETY: the format has one argument, of the type that it names.
    unsafe { printf(c"%zu\n".as_ptr(), size_of::<T>()) };
    0
}
