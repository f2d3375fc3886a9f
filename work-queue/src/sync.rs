//! The atomics and cells, which loom's replace under `--cfg loom`, and the memory orderings, each named after the accesses that
//! it orders.

#[cfg(not(loom))]
mod types {
    pub(crate) use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

    /// `core::cell::UnsafeCell` with the accessors of loom's, by which loom records every access.
    pub(crate) struct UnsafeCell<T>(core::cell::UnsafeCell<T>);

    impl<T> UnsafeCell<T> {
        pub(crate) const fn new(value: T) -> Self {
            UnsafeCell(core::cell::UnsafeCell::new(value))
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
    pub(crate) use loom::sync::atomic::{AtomicBool, AtomicU32, Ordering};
}

pub(crate) use types::*;

macro_rules! orderings {
    ($($(#[$doc:meta])* $name:ident: $strong:ident or $($weak:ident),+;)*) => {
        /// One name for each ordering that the proof of the queue depends on.
        #[cfg(not(loom))]
        #[cfg_attr(not(target_has_atomic = "8"), allow(dead_code, reason = "no queue in a static, or on the heap, has ends there"))]
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
    /// The writer hands the slots before the tail to the reader.
    publish_tail: Release or Relaxed;
    /// The reader takes them over.
    observe_tail: Acquire or Relaxed;
    /// The reader hands the slots before the head back to the writer.
    publish_head: Release or Relaxed;
    /// The writer takes them over.
    observe_head: Acquire or Relaxed;
    /// An end leaves: if the other one observes that, it also observes everything that the first did before.
    publish_leave: Release or Relaxed;
    /// An end observes that the other has left.
    observe_leave: Acquire or Relaxed;
    /// An end leaves storage that is not the caller's; the second one drops the remaining jobs.
    leave_second: AcqRel or Acquire, Release, Relaxed;
    /// A queue in a static has no ends any more.
    publish_free: Release or Relaxed;
    /// A queue in a static is split, after other ends have left perhaps.
    split: Acquire or Relaxed;
}

macro_rules! checks {
    ($($(#[$doc:meta])* $name:ident;)*) => {
        /// One name for each check of the mark that the proof of the queue depends on.
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
    /// The oldest job is taken only after the jobs before a reset were discarded.
    mark_in_take;
    /// The oldest jobs are.
    mark_in_batch;
    /// A job is searched for only after the jobs before a reset were discarded.
    mark_in_find;
}
