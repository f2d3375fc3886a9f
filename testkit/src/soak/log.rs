//! The trace of a session, and places in it.

use core::fmt::Arguments;
use core::time::Duration;

/// The output of a session's trace: standard output, or none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Log {
    pub(super) on: bool,
}

impl Log {
    /// Nowhere.
    pub const OFF: Self = Self { on: false };
    /// To standard output.
    pub const ON: Self = Self { on: true };

    /// Writes a line of the trace.
    pub fn line(self, now: Duration, what: Arguments<'_>) {
        if self.on {
            println!("{:>12.3} ms  {what}", now.as_secs_f64() * 1e3);
        }
    }
}

/// The number of transmissions that each end, A and B, has made so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Mark(
    /// The transmissions that end A had made.
    pub usize,
    /// The transmissions that end B had made.
    pub usize,
);

impl Mark {
    /// After them all.
    pub const END: Self = Self(usize::MAX, usize::MAX);
}
