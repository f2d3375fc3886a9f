//! The atomics and cells, which loom's replace under `--cfg loom`, and the memory orderings, each named after what it orders.

#[cfg(not(loom))]
mod types {
    pub(crate) use core::sync::atomic::{AtomicBool, Ordering};

    /// `core::cell::UnsafeCell` with the accessors of loom's, by which loom records every access.
    pub(crate) struct UnsafeCell<T>(core::cell::UnsafeCell<T>);

    impl<T> UnsafeCell<T> {
        pub(crate) const fn new(value: T) -> Self {
            UnsafeCell(core::cell::UnsafeCell::new(value))
        }

        #[inline(always)]
        pub(crate) fn with<R>(&self, access: impl FnOnce(*const T) -> R) -> R {
            access(self.0.get())
        }

        #[inline(always)]
        pub(crate) fn with_mut<R>(&self, access: impl FnOnce(*mut T) -> R) -> R {
            access(self.0.get())
        }
    }
}

#[cfg(loom)]
mod types {
    pub(crate) use loom::cell::UnsafeCell;
    pub(crate) use loom::sync::atomic::{AtomicBool, Ordering};
}

pub(crate) use types::*;

/// The type of a stored position or stamp: 64 bits, or 32 where a processor has no 64-bit atomics (`--cfg narrow` tests that).
#[cfg(all(target_has_atomic = "64", not(narrow)))]
mod word {
    pub(crate) type Word = u64;
    pub(crate) type SignedWord = i64;
    #[cfg(not(loom))]
    pub(crate) use core::sync::atomic::AtomicU64 as AtomicWord;
    #[cfg(loom)]
    pub(crate) use loom::sync::atomic::AtomicU64 as AtomicWord;
}

#[cfg(any(not(target_has_atomic = "64"), narrow))]
mod word {
    pub(crate) type Word = u32;
    pub(crate) type SignedWord = i32;
    #[cfg(not(loom))]
    pub(crate) use core::sync::atomic::AtomicU32 as AtomicWord;
    #[cfg(loom)]
    pub(crate) use loom::sync::atomic::AtomicU32 as AtomicWord;
}

pub(crate) use word::*;

macro_rules! orderings {
    ($($(#[$doc:meta])* $name:ident: $strong:ident or $($weak:ident),+;)*) => {
        /// One name for each ordering that the proof of the queue depends on.
        #[cfg(not(loom))]
        pub(crate) mod order {
            $($(#[$doc])* #[inline(always)] pub(crate) const fn $name() -> super::Ordering { super::Ordering::$strong })*
        }

        /// The same, but each can be weakened by a test, which must then fail.
        #[cfg(loom)]
        pub mod order {
            use loom::sync::atomic::Ordering;

            std::thread_local! {
                static WEAKENED: core::cell::Cell<Option<(&'static str, Ordering)>> = const { core::cell::Cell::new(None) };
            }

            /// Every way to weaken one ordering.
            pub const MUTANTS: &[(&str, Ordering)] = &[$($((stringify!($name), Ordering::$weak)),+),*];

            /// Weakens one ordering for everything that runs on this thread from now on: loom runs its threads on it.
            pub fn weaken(mutant: Option<(&'static str, Ordering)>) {
                WEAKENED.set(mutant);
            }

            $($(#[$doc])* pub(crate) fn $name() -> Ordering {
                match WEAKENED.get() {
                    Some((stringify!($name), weak)) => weak,
                    _ => Ordering::$strong,
                }
            })*
        }
    };
}

orderings! {
    /// The writer hands a filled slot to the reader.
    publish_stamp: Release or Relaxed;
    /// The reader takes over a filled slot.
    observe_stamp: Acquire or Relaxed;
    /// The reader hands a completed slot back to the writer.
    publish_head: Release or Relaxed;
    /// The writer takes over completed slots.
    observe_head: Acquire or Relaxed;
    /// The writer publishes which jobs a reset discards.
    publish_watermark: Release or Relaxed;
    /// The reader reads which jobs a reset discards.
    observe_watermark: Acquire or Relaxed;
    /// An end is dropped: if the other end observes that, it also observes everything that the first end did before.
    publish_abandoned: Release or Relaxed;
    /// An end observes that the other was dropped.
    observe_abandoned: Acquire or Relaxed;
    /// An end of boxed storage is dropped; the second one drops the remaining jobs and frees the storage.
    #[cfg_attr(not(feature = "alloc"), allow(dead_code))]
    leave: AcqRel or Acquire, Release, Relaxed;
}

macro_rules! checks {
    ($($(#[$doc:meta])* $name:ident;)*) => {
        /// One name for each check of the watermark that the proof of the queue depends on.
        #[cfg(not(loom))]
        pub(crate) mod check {
            $($(#[$doc])* #[inline(always)] pub(crate) const fn $name() -> bool { true })*
        }

        /// The same, but each can be removed by a test, which must then fail.
        #[cfg(loom)]
        pub mod check {
            std::thread_local! {
                static REMOVED: core::cell::Cell<Option<&'static str>> = const { core::cell::Cell::new(None) };
            }

            /// Every check that can be removed.
            pub const MUTANTS: &[&str] = &[$(stringify!($name)),*];

            /// Removes one check for everything that runs on this thread from now on: loom runs its threads on it.
            pub fn remove(mutant: Option<&'static str>) {
                REMOVED.set(mutant);
            }

            $($(#[$doc])* pub(crate) fn $name() -> bool {
                REMOVED.get() != Some(stringify!($name))
            })*
        }
    };
}

checks! {
    /// The oldest job is taken only after what a reset discards was discarded.
    watermark_in_take;
    /// A job is searched for only after what a reset discards was discarded.
    watermark_in_find;
}
