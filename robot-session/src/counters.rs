//! What every session counts.

use core::fmt::Debug;

/// The counters of an end: its own, and two that the loop of every session keeps. [`counters!`](crate::counters!) implements it.
pub trait Counters: Copy + Default + Debug + PartialEq {
    /// Inputs that the machine's state did not allow.
    fn unexpected(&mut self) -> &mut u64;

    /// Notices dropped because the event queue was full.
    fn dropped_notices(&mut self) -> &mut u64;
}

/// Implements [`Counters`](trait@crate::Counters) for a struct with the fields `unexpected` and `dropped_notices`.
#[macro_export]
macro_rules! counters {
    ($counters:ty) => {
        impl $crate::Counters for $counters {
            fn unexpected(&mut self) -> &mut u64 {
                &mut self.unexpected
            }

            fn dropped_notices(&mut self) -> &mut u64 {
                &mut self.dropped_notices
            }
        }
    };
}
