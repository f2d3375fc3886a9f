//! The panic handler and the C library's start code for every program (on a Cortex-M, the emulator's start code), and
//! a run of a session as on a board.
#![no_std]

#[cfg_attr(target_os = "none", path = "emulator.rs")]
#[cfg_attr(not(target_os = "none"), path = "c.rs")]
mod host;

#[cfg(target_os = "none")]
pub use host::exit;
pub use host::print_size;

use core::hint::black_box;
use core::time::Duration;

use robot_session::{Session, Step, Steps};

/// Runs a session as a board does, with inputs that are opaque to the compiler: bytes, time, a user's call, and all
/// outputs. Prints the size of the session in bytes.
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
    let mut steps = Steps::NEW;
    while let step @ (Step::Event(_) | Step::Write(_)) = steps.next(session, now, buffer) {
        black_box(step);
    }
    black_box(session.poll_timeout());
    session.handle_disconnected(now);
    print_size(session)
}
