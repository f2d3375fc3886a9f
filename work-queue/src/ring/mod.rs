//! The slots: which end owns each, and which store hands it over. All unsafe code is in this module.
//!
//! # The invariant
//!
//! ```text
//!    head                         tail                    head + capacity
//!     |  published: the READER's   |  free: the WRITER's   |
//! ```
//!
//! 1. Slots from `head` to `tail` are the reader's and contain a job, unless their flag in `done` is set because the job was
//!    completed before its turn. The flags are the reader's alone.
//! 2. Slots from `tail` to `head + capacity` are the writer's and do not contain jobs.
//! 3. Only the writer stores `tail`: the release store hands the slots before it to the reader, whose acquire load takes
//!    them over. Only the reader stores `head`, and hands slots back in the same way.
//! 4. An end stores the last observed position of the other one as its cursor's `end`: slots from `at` to `end` are its own.
//!    They are on one lap up to `stop`. Cursors are made only here, from the ring's own limits: their index is below the
//!    capacity.
//! 5. Only the writer stores the mark, which hands nothing over: the reader discards no slots but its own. A job is
//!    published after the marks before it: an end that has acquired a tail finds the mark from which the jobs before it are
//!    numbered.
//! 6. There is one writer and one reader. The end that leaves second drops the remaining jobs between `head` and `tail`, if
//!    the ends own the storage; otherwise the queue drops them when it is dropped or split again.

mod reader;
mod storage;
mod writer;

use core::cell::Cell;
use core::mem::MaybeUninit;
use core::ptr::NonNull;

pub use reader::{Iter, Reader, TakenBatch, TakenJob};
pub use storage::{Ends, WorkQueue};
#[cfg(all(feature = "alloc", target_has_atomic = "8"))]
pub use storage::{boxed, boxed_with};
pub use writer::{Batch, Claim, Writer};

use crate::cursor::{Cursor, Limits, Mark};
use crate::sync::{AtomicBool, AtomicU32, Ordering, UnsafeCell, order};
use crate::wake::Wake;

/// Two cache lines, because processors fetch them in pairs.
#[cfg_attr(target_pointer_width = "64", repr(align(128)))]
#[cfg_attr(not(target_pointer_width = "64"), repr(align(32)))]
struct Padded<T>(T);

/// The state that the two ends share.
struct Shared<T> {
    tail: Padded<AtomicU32>,
    head: Padded<AtomicU32>,
    /// Seldom written, so that looking at it costs no transfer.
    control: Padded<Control<T>>,
}

struct Control<T> {
    mark: AtomicU32,
    /// Whether an end has left.
    abandoned: AtomicBool,
    /// Whether a queue in a static has ends.
    #[cfg(target_has_atomic = "8")]
    in_use: AtomicBool,
    limits: Limits,
    // Written while there are no ends.
    owner: Cell<Owner>,
    slots: Cell<*const Slot<T>>,
    done: Cell<*const AtomicBool>,
}

/// The owner of the storage.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Owner {
    /// The caller, which outlives the ends.
    Caller,
    /// No owner: it is in a static. The ends own its jobs.
    #[cfg(target_has_atomic = "8")]
    Nobody,
    /// The two ends.
    #[cfg(all(feature = "alloc", target_has_atomic = "8"))]
    Ends,
}

#[cfg_attr(not(loom), repr(transparent))]
struct Slot<T>(UnsafeCell<MaybeUninit<T>>);

impl<T> Slot<T> {
    /// Returns a pointer to the job: only for the owner of the slot, so that loom may count each access as a write.
    #[inline(always)]
    fn place(&self) -> *mut T {
        self.0.with_mut(|place| place.cast())
    }
}

impl<T> Shared<T> {
    #[inline(always)]
    fn limits(&self) -> Limits {
        self.control.0.limits
    }

    #[inline(always)]
    fn tail(&self) -> u32 {
        self.tail.0.load(order::observe_tail())
    }

    #[inline(always)]
    fn set_tail(&self, tail: u32) {
        self.tail.0.store(tail, order::publish_tail());
    }

    #[inline(always)]
    fn head(&self) -> u32 {
        self.head.0.load(order::observe_head())
    }

    #[inline(always)]
    fn set_head(&self, head: u32) {
        self.head.0.store(head, order::publish_head());
    }

    #[inline(always)]
    fn mark(&self) -> Mark {
        Mark(self.control.0.mark.load(Ordering::Relaxed))
    }

    fn set_mark(&self, mark: Mark) {
        self.control.0.mark.store(mark.0, Ordering::Relaxed);
    }

    fn is_abandoned(&self) -> bool {
        self.control.0.abandoned.load(order::observe_leave())
    }

    #[inline(always)]
    fn slot(&self, cursor: &Cursor) -> &Slot<T> {
        at(&self.control.0.slots, cursor)
    }

    /// Returns whether the job of one of the reader's slots was completed before its turn.
    fn done(&self, cursor: &Cursor) -> &AtomicBool {
        at(&self.control.0.done, cursor)
    }

    /// Returns the slots of a row, to iterate over them without computing each index.
    #[inline(always)]
    fn row(&self, cursor: &Cursor, slots: u32) -> &[Slot<T>] {
        // SAFETY: as in `at`, up to the stop of the cursor; slots contain cells, so that others may write to theirs.
        unsafe { core::slice::from_raw_parts(self.control.0.slots.get().add(cursor.index()), slots as usize) }
    }

    /// Drops the jobs that are left.
    ///
    /// # Safety
    ///
    /// Both ends are out of use, and the location of the slots is known.
    unsafe fn drop_jobs(&self) {
        let tail = self.tail.0.load(Ordering::Relaxed);
        loop {
            let head = self.head.0.load(Ordering::Relaxed);
            if head == tail {
                return;
            }
            let cursor = Cursor::new(head, 1, self.limits());
            // SAFETY: no other end has the slot, and by 1 it contains a job unless its flag is set; the head moves over it.
            let job = (!self.done(&cursor).load(Ordering::Relaxed))
                .then(|| unsafe { self.slot(&cursor).place().read() });
            self.head.0.store(self.limits().after(head, 1), Ordering::Relaxed);
            drop(job); // last: should it panic, it has been dropped once
        }
    }
}

/// Returns the element at a cursor in one of the two arrays. There are ends, which have recorded the address of the
/// array.
#[inline(always)]
fn at<'a, E>(array: &'a Cell<*const E>, cursor: &Cursor) -> &'a E {
    // SAFETY: by 4 the index is below the capacity, and the arrays outlive the ends.
    unsafe { &*array.get().add(cursor.index()) }
}

/// An end's hold on the ring: one pointer, so that rarely called functions take it in a register.
struct Hold<T>(NonNull<Shared<T>>);

impl<T> Clone for Hold<T> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for Hold<T> {}

// SAFETY: jobs go to the other end, and by the invariant no end touches a slot that is the other's.
unsafe impl<T: Send> Send for Hold<T> {}

impl<T> core::ops::Deref for Hold<T> {
    type Target = Shared<T>;

    #[inline(always)]
    fn deref(&self) -> &Shared<T> {
        // SAFETY: the storage outlives the ends.
        unsafe { self.0.as_ref() }
    }
}

impl<T> Hold<T> {
    /// Called when an end leaves.
    #[cold]
    #[inline(never)]
    fn leave(self) {
        let control = &self.control.0;
        if control.owner.get() == Owner::Caller {
            return control.abandoned.store(true, order::publish_leave());
        }
        #[cfg(target_has_atomic = "8")]
        if control.abandoned.swap(true, order::leave_second()) {
            // SAFETY: the other end has left before, which was its last access, and all that it did is visible here.
            unsafe {
                self.drop_jobs();
                #[cfg(feature = "alloc")]
                if control.owner.get() == Owner::Ends {
                    return storage::free(self.0);
                }
            }
            control.in_use.store(false, order::publish_free());
        }
    }
}

/// The parts of each end: its hold on the ring, and the hook that wakes the other end.
struct End<T, W: Wake> {
    hold: Hold<T>,
    other: W,
}

impl<T, W: Wake> Drop for End<T, W> {
    #[inline(always)]
    fn drop(&mut self) {
        self.hold.leave();
        self.other.wake();
    }
}
