use core::cell::Cell;
use core::fmt;
use core::mem::MaybeUninit;
use core::ptr::{self, NonNull};

use super::{Control, Hold, Owner, Padded, Reader, Shared, Slot, Writer};
use crate::cursor::{Cursor, Limits, Mark};
use crate::error::ConfigError;
#[cfg(target_has_atomic = "8")]
use crate::sync::order;
use crate::sync::{AtomicBool, AtomicU32, Ordering, UnsafeCell};
use crate::wake::{NoWake, Wake};

/// The highest capacity: the source's controller has no indices of five digits.
const MAX_CAPACITY: usize = 9999;

/// The alignment of an array of slots, so that a job whose size is a power of two lies in one cache line.
const LINE: usize = align_of::<Padded<u8>>();

/// A queue with its storage: arrays, or slices on the heap.
#[repr(C)]
struct Ring<T, S, D> {
    /// First: an end has a pointer to this alone.
    shared: Shared<T>,
    /// An array begins on a cache line here.
    slots: S,
    done: D,
}

/// A queue of at most `N` jobs, stored inline: `1..=9999`, any number, not only powers of two.
///
/// [`split`](Self::split) it into its two ends, or [`split_static`](Self::split_static) one in a `static`. When the queue is
/// dropped, its remaining jobs are dropped too.
pub struct WorkQueue<T, const N: usize>(Ring<T, [Slot<T>; N], [AtomicBool; N]>);

// SAFETY: jobs go from one end to the other; `split_static` alone uses a shared queue, and makes one pair of ends at a time.
unsafe impl<T: Send, const N: usize> Sync for WorkQueue<T, N> {}

// SAFETY: the jobs go with it. It has no ends, which would borrow it, and `begin` sets its pointers again at its new place.
unsafe impl<T: Send, const N: usize> Send for WorkQueue<T, N> {}

/// The two ends of a queue, which are woken by `R` (the reader) and `W` (the writer).
pub type Ends<'q, T, R = NoWake, W = NoWake> = (Writer<'q, T, R>, Reader<'q, T, W>);

/// Makes a function constant, except under loom, whose atomics are not constant.
macro_rules! constant {
    ($($(#[$doc:meta])* $v:vis fn $name:ident $(<const $max:ident: u16>)? ($($args:tt)*) -> $result:ty $body:block)*) => {$(
        #[cfg(not(loom))]
        $(#[$doc])* $v const fn $name $(<const $max: u16>)? ($($args)*) -> $result $body
        #[cfg(loom)]
        $(#[$doc])* $v fn $name $(<const $max: u16>)? ($($args)*) -> $result $body
    )*};
}

impl<T> Shared<T> {
    constant! {
        fn new(capacity: usize, max: u16) -> Self {
            #[expect(clippy::cast_possible_truncation, reason = "it was checked")]
            let capacity = capacity as u32;
            Shared {
                tail: Padded(AtomicU32::new(0)),
                head: Padded(AtomicU32::new(0)),
                control: Padded(Control {
                    mark: AtomicU32::new(0),
                    abandoned: AtomicBool::new(false),
                    #[cfg(target_has_atomic = "8")]
                    in_use: AtomicBool::new(false),
                    limits: Limits { capacity, max },
                    owner: Cell::new(Owner::Caller),
                    slots: Cell::new(ptr::null()),
                    done: Cell::new(ptr::null()),
                }),
            }
        }
    }
}

impl<T> Slot<T> {
    constant! {
        fn new() -> Self {
            Slot(UnsafeCell::new(MaybeUninit::uninit()))
        }
    }
}

const fn check_config(capacity: usize, max_number: u16) -> Result<(), ConfigError> {
    if capacity == 0 || capacity > MAX_CAPACITY {
        Err(ConfigError::Capacity { capacity })
    } else if max_number as usize <= capacity {
        Err(ConfigError::MaxNumber { max_number, capacity })
    } else {
        Ok(())
    }
}

impl<T, const N: usize> WorkQueue<T, N> {
    /// Creates an empty queue whose jobs are numbered `1..=max_number`, then 1 again.
    ///
    /// Both ends of a link must use the same `max_number`. If possible, it should be at least the number of jobs of an order.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] if `N` is outside `1..=9999`, or if `max_number` is not above it, so that one number could be queued
    /// twice.
    pub fn new(max_number: u16) -> Result<Self, ConfigError> {
        check_config(N, max_number).map(|()| Self::empty(max_number))
    }

    constant! {
        /// Creates a queue as [`new`](Self::new) does, for a `static`: invalid parameters do not compile.
        ///
        /// ```
        /// use robot_work_queue::{NoWake, WorkQueue};
        ///
        /// static QUEUE: WorkQueue<u32, 64> = WorkQueue::numbered::<1000>();
        ///
        /// let (mut writer, reader) = QUEUE.split_static(NoWake, NoWake).expect("it has no ends yet");
        /// writer.claim()?.push(7);
        /// assert_eq!(reader.len(), 1);
        /// # Ok::<(), robot_work_queue::Full>(())
        /// ```
        ///
        /// ```compile_fail,E0080
        /// # use robot_work_queue::WorkQueue;
        /// static QUEUE: WorkQueue<u32, 64> = WorkQueue::numbered::<64>(); // one number could be queued twice
        /// ```
        pub fn numbered<const MAX_NUMBER: u16>() -> Self {
            const { assert!(check_config(N, MAX_NUMBER).is_ok(), "1 to 9999 jobs, and more numbers than jobs") };
            Self::empty(MAX_NUMBER)
        }

        fn empty(max_number: u16) -> Self {
            #[cfg(not(loom))]
            let (done, slots) = ([const { AtomicBool::new(false) }; N], [const { Slot::new() }; N]);
            #[cfg(loom)]
            let (done, slots) =
                (core::array::from_fn(|_| AtomicBool::new(false)), core::array::from_fn(|_| Slot::new()));
            WorkQueue(Ring { shared: Shared::new(N, max_number), slots, done })
        }
    }

    /// Splits the queue into its two ends. Each split empties the queue: the remaining jobs are dropped, and the next number
    /// is 1.
    pub fn split(&mut self) -> Ends<'_, T> {
        self.split_with(NoWake, NoWake)
    }

    /// Splits the queue as [`split`](Self::split) does, for ends that sleep: `reader` wakes the reader, `writer` the writer.
    pub fn split_with<R: Wake, W: Wake>(&mut self, reader: R, writer: W) -> Ends<'_, T, R, W> {
        self.split_at(0, reader, writer)
    }

    /// Splits the queue as [`split`](Self::split) does, beginning at a given lap, for tests in which laps wrap around.
    #[doc(hidden)]
    pub fn split_at_lap(&mut self, lap: u16) -> Ends<'_, T> {
        self.split_at(u32::from(lap) * self.0.shared.limits().capacity, NoWake, NoWake)
    }

    fn split_at<R: Wake, W: Wake>(&mut self, start: u32, reader: R, writer: W) -> Ends<'_, T, R, W> {
        self.0.begin(Owner::Caller, start);
        Hold(NonNull::from(&self.0).cast()).ends(start, reader, writer)
    }

    /// Returns the two ends of a queue in a `static`, as [`split_with`](Self::split_with); `None` while it has ends. The end
    /// that is dropped last drops the remaining jobs.
    #[cfg(target_has_atomic = "8")]
    pub fn split_static<R: Wake, W: Wake>(
        &'static self,
        reader: R,
        writer: W,
    ) -> Option<Ends<'static, T, R, W>> {
        let in_use = &self.0.shared.control.0.in_use;
        in_use.compare_exchange(false, true, order::split(), Ordering::Relaxed).ok()?;
        self.0.begin(Owner::Nobody, 0);
        Some(Hold(NonNull::from(&self.0).cast()).ends(0, reader, writer))
    }
}

impl<T, const N: usize> Drop for WorkQueue<T, N> {
    fn drop(&mut self) {
        self.0.begin(Owner::Caller, 0);
    }
}

impl<T, const N: usize> fmt::Debug for WorkQueue<T, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let max_number = self.0.shared.limits().max;
        f.debug_struct("WorkQueue")
            .field("capacity", &N)
            .field("max_number", &max_number)
            .finish_non_exhaustive()
    }
}

/// Returns the two ends of a queue of at most `capacity` jobs on the heap, numbered `1..=max_number`, then 1 again.
///
/// The ends own the queue together and can be moved to different threads. The end that is dropped last drops the remaining
/// jobs. Nothing is allocated later.
///
/// # Errors
///
/// [`ConfigError`] if `capacity` is outside `1..=9999`, or if `max_number` is not above it.
#[cfg(all(feature = "alloc", target_has_atomic = "8"))]
pub fn boxed<T>(capacity: usize, max_number: u16) -> Result<Ends<'static, T>, ConfigError> {
    boxed_with(capacity, max_number, NoWake, NoWake)
}

/// Creates a queue as [`boxed`] does, for ends that sleep: `reader` wakes the reader, `writer` the writer.
///
/// # Errors
///
/// As [`boxed`].
#[cfg(all(feature = "alloc", target_has_atomic = "8"))]
pub fn boxed_with<T, R: Wake, W: Wake>(
    capacity: usize,
    max_number: u16,
    reader: R,
    writer: W,
) -> Result<Ends<'static, T, R, W>, ConfigError> {
    check_config(capacity, max_number)?;
    let done = (0..capacity).map(|_| AtomicBool::new(false)).collect();
    // Loom's cells cannot be used at another address than the one at which they were created.
    let spare = if cfg!(loom) { 0 } else { LINE.checked_div(size_of::<Slot<T>>()).unwrap_or(0) };
    let slots = (0..capacity + spare).map(|_| Slot::new()).collect();
    let ring: BoxedRing<T> = Ring { shared: Shared::new(capacity, max_number), slots, done };
    let ring = alloc::boxed::Box::new(ring);
    ring.begin(Owner::Ends, 0);
    Ok(Hold(NonNull::from(alloc::boxed::Box::leak(ring)).cast()).ends(0, reader, writer))
}

#[cfg(all(feature = "alloc", target_has_atomic = "8"))]
type BoxedRing<T> = Ring<T, alloc::boxed::Box<[Slot<T>]>, alloc::boxed::Box<[AtomicBool]>>;

/// Frees a ring.
///
/// # Safety
///
/// The ring came from [`boxed_with`], and is no longer used.
#[cfg(all(feature = "alloc", target_has_atomic = "8"))]
pub(super) unsafe fn free<T>(ring: NonNull<Shared<T>>) {
    // SAFETY: as above; `shared` is first in it.
    drop(unsafe { alloc::boxed::Box::from_raw(ring.cast::<BoxedRing<T>>().as_ptr()) });
}

impl<T, S: AsRef<[Slot<T>]>, D: AsRef<[AtomicBool]>> Ring<T, S, D> {
    /// Returns the first slot: on a cache line, if there are enough to spare.
    fn first_slot(&self) -> *const Slot<T> {
        let slots = self.slots.as_ref();
        let spare = (slots.len() - self.shared.limits().capacity as usize) * size_of::<Slot<T>>();
        let first = slots.as_ptr();
        let to_line = first.cast::<u8>().align_offset(LINE);
        first.wrapping_byte_add(if to_line <= spare { to_line } else { 0 })
    }

    /// Drops the remaining jobs, and sets up the shared state for ends that begin at `start`. No ends exist at this
    /// time: the ring is borrowed as a whole, new, or a static's that is not in use.
    fn begin(&self, owner: Owner, start: u32) {
        self.shared.control.0.slots.set(self.first_slot()); // it may have moved
        self.shared.control.0.done.set(self.done.as_ref().as_ptr());
        // SAFETY: as above. A new ring has no jobs.
        unsafe { self.shared.drop_jobs() };
        self.done.as_ref().iter().for_each(|done| done.store(false, Ordering::Relaxed));
        let shared = &self.shared;
        shared.control.0.owner.set(owner);
        shared.control.0.abandoned.store(false, Ordering::Relaxed);
        shared.tail.0.store(start, Ordering::Relaxed);
        shared.head.0.store(start, Ordering::Relaxed);
        shared.set_mark(Mark::new(start, 1));
    }
}

impl<T> Hold<T> {
    /// Returns the two ends of a ring that begins at `start`.
    fn ends<'q, R: Wake, W: Wake>(self, start: u32, reader: R, writer: W) -> Ends<'q, T, R, W> {
        let cursor = Cursor::new(start, 1, self.limits());
        (Writer::new(self, cursor, reader), Reader::new(self, cursor, writer))
    }
}
