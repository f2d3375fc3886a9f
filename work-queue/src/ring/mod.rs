//! The slots, and all of the `unsafe` code: which end owns each slot, and which store hands it over.
//!
//! # The invariant
//!
//! `capacity` slots form a ring. A [`Position`] names one slot on one lap. Three positions follow one another, never more
//! than a lap apart:
//!
//! ```text
//!    head                        tail                   head + 1 lap
//!     |  published: the READER's  |  free: the WRITER's  |
//! ```
//!
//! 1. The slots from `head` to `tail` belong to the reader: their stamp is of their position's lap, their job is
//!    initialised (but see 5). The reader reads the job and moves it out.
//! 2. The slots from `tail` to `head` + 1 lap belong to the writer: their stamp is of the lap before, their job is not
//!    initialised. The writer writes the job, then the stamp.
//! 3. `tail` belongs to the writer and is not in shared memory. The release store of a **stamp** of this lap advances it by one
//!    slot and hands that slot to the reader, whose acquire load of the same stamp takes it over.
//! 4. `head` is stored by the reader alone. The release store of **head** hands every slot before it back to the writer,
//!    whose acquire load of `head` takes them over. The writer keeps as `space` a `head` that it has loaded,
//!    plus one lap: the slots from `tail` to `space` are its own, and at `tail == space` it must load `head` again.
//! 5. When a job is completed out of order, it is moved out, and the reader marks its stamp as completed: the slot remains
//!    the reader's. `head` passes such slots, `ahead` of them, when it reaches them, and is never at one of them afterwards.
//! 6. The **watermark** is stored by the writer alone, and is an earlier `tail`: the reader discards every slot before it. The
//!    release store publishes it, and the reader's acquire load takes over these slots. It is always less than half of all
//!    laps older than `tail`.
//! 7. There is one [`WriteEnd`] and one [`ReadEnd`]. With borrowed storage the lifetime of their owners guarantees that the ring
//!    outlives both. With owned storage the end that is the second to set `abandoned` drops and frees the ring.

use core::mem::MaybeUninit;
use core::ptr::NonNull;

mod read;
mod write;

pub(crate) use read::{Held, ReadEnd, Waiting};
pub(crate) use write::{Reserved, WriteEnd};

use crate::position::{Position, Stamp};
use crate::sync::{AtomicBool, AtomicWord, Ordering, UnsafeCell, Word, order};

/// Separates what one end writes from the cache lines that the other reads. Two lines, because processors fetch them in pairs.
#[cfg_attr(target_pointer_width = "64", repr(align(128)))]
#[cfg_attr(not(target_pointer_width = "64"), repr(align(32)))]
struct Padded<T>(T);

/// The storage of a queue: `[Slot<T>; N]`, used by both ends as `[Slot<T>]`.
#[repr(C)]
pub(crate) struct Ring<S: ?Sized> {
    head: Padded<AtomicWord>,
    control: Padded<Control>,
    slots: S,
}

/// What is seldom written, so that reading it seldom transfers a cache line.
struct Control {
    watermark: AtomicWord,
    abandoned: AtomicBool,
}

/// A job of 56 bytes and its stamp fill one cache line.
#[repr(C)]
pub(crate) struct Slot<T> {
    stamp: AtomicWord,
    job: UnsafeCell<MaybeUninit<T>>,
}

macro_rules! const_unless_loom {
    ($($item:tt)*) => {
        #[cfg(not(loom))]
        pub(crate) const $($item)*
        #[cfg(loom)]
        pub(crate) $($item)*
    };
}

impl<T, const N: usize> Ring<[Slot<T>; N]> {
    const_unless_loom! {
        fn new() -> Self {
            let head = Padded(AtomicWord::new(Position::START.into_word()));
            #[cfg(not(loom))]
            let slots = [const { Slot::new(Position::START) }; N];
            #[cfg(loom)]
            let slots = core::array::from_fn(|_| Slot::new(Position::START));
            Ring { head, control: Padded(Control::new()), slots }
        }
    }
}

impl Control {
    const_unless_loom! {
        fn new() -> Self {
            Control { watermark: AtomicWord::new(Position::START.into_word()), abandoned: AtomicBool::new(false) }
        }
    }
}

impl<T> Slot<T> {
    // A free slot of a ring that begins at `start`.
    const_unless_loom! {
        fn new(start: Position) -> Self {
            Slot {
                stamp: AtomicWord::new(start.lap_before().stamp(0)),
                job: UnsafeCell::new(MaybeUninit::uninit()),
            }
        }
    }

    #[inline(always)]
    fn publish(&self, stamp: Word) {
        self.stamp.store(stamp, order::publish_stamp());
    }

    /// What the slot holds at `position`.
    #[inline(always)]
    fn observe(&self, position: Position) -> Stamp {
        position.read(self.stamp.load(order::observe_stamp()))
    }

    /// As [`observe`](Self::observe), of a slot that is known to be the reader's.
    #[inline(always)]
    fn observe_owned(&self, position: Position) -> Stamp {
        position.read(self.stamp.load(Ordering::Relaxed))
    }

    /// Marks a slot of the reader's, which remains the reader's.
    #[inline(always)]
    fn mark_completed(&self, position: Position) {
        self.stamp.store(position.stamp_completed(), Ordering::Relaxed);
    }

    /// # Safety
    ///
    /// The slot is the caller's and holds a job. The caller ensures that the slot does not count as holding one afterwards.
    #[inline(always)]
    unsafe fn move_out(&self) -> T {
        // SAFETY: as above.
        self.job.with(|job| unsafe { (*job).assume_init_read() })
    }
}

impl<T> Ring<[Slot<T>]> {
    /// Drops the remaining jobs and returns two ends that begin at `start`.
    pub(crate) fn restart(&mut self, start: Position) -> (WriteEnd<T>, ReadEnd<T>) {
        self.drop_jobs();
        for slot in &self.slots {
            slot.stamp.store(start.lap_before().stamp(0), Ordering::Relaxed);
        }
        self.head.0.store(start.into_word(), Ordering::Relaxed);
        self.control.0.watermark.store(start.into_word(), Ordering::Relaxed);
        self.control.0.abandoned.store(false, Ordering::Relaxed);
        let ring = NonNull::from(&*self);
        let hold = || Hold {
            ring,
            #[cfg(feature = "alloc")]
            owned: false,
        };
        (WriteEnd::new(hold(), start), ReadEnd::new(hold(), start))
    }

    #[inline(always)]
    fn capacity(&self) -> usize {
        self.slots.len()
    }

    /// # Safety
    ///
    /// `position` is the position of a slot: its index is below the capacity.
    #[inline(always)]
    unsafe fn slot(&self, position: Position) -> &Slot<T> {
        debug_assert!(position.index() < self.slots.len());
        // SAFETY: as above.
        unsafe { self.slots.get_unchecked(position.index()) }
    }

    #[inline(always)]
    fn head(&self) -> Position {
        Position::from_word(self.head.0.load(order::observe_head()))
    }

    #[inline(always)]
    fn set_head(&self, head: Position) {
        self.head.0.store(head.into_word(), order::publish_head());
    }

    #[inline(always)]
    fn watermark(&self) -> Position {
        Position::from_word(self.control.0.watermark.load(order::observe_watermark()))
    }

    fn set_watermark(&self, watermark: Position) {
        self.control.0.watermark.store(watermark.into_word(), order::publish_watermark());
    }

    /// Drops the jobs between `head` and `tail`: by `&mut` neither end exists any more.
    pub(crate) fn drop_jobs(&mut self) {
        let mut position = Position::from_word(self.head.0.load(Ordering::Relaxed));
        for _ in 0..self.slots.len() {
            let Some(slot) = self.slots.get(position.index()) else { return };
            match slot.observe_owned(position) {
                Stamp::Job(_) => {
                    slot.mark_completed(position); // first: a panicking drop must not run twice
                    // SAFETY: by 1 the job is initialised; by `&mut self` nobody else accesses it; the stamp marks it as gone.
                    slot.job.with_mut(|job| unsafe { (*job).assume_init_drop() });
                }
                Stamp::Completed => {}
                Stamp::Free => return,
            }
            position = position.next(self.slots.len());
        }
    }
}

/// A pointer to the ring. Each end has one; together they keep an owned ring alive.
struct Hold<T> {
    ring: NonNull<Ring<[Slot<T>]>>,
    #[cfg(feature = "alloc")]
    owned: bool,
}

impl<T> Hold<T> {
    #[inline(always)]
    fn ring(&self) -> &Ring<[Slot<T>]> {
        // SAFETY: by 7 the ring outlives this hold, and no `&mut` to it exists as long as there is a hold.
        unsafe { self.ring.as_ref() }
    }

    fn is_abandoned(&self) -> bool {
        self.ring().control.0.abandoned.load(order::observe_abandoned())
    }
}

impl<T> Drop for Hold<T> {
    fn drop(&mut self) {
        #[cfg(feature = "alloc")]
        if self.owned {
            if self.ring().control.0.abandoned.swap(true, order::leave()) {
                // SAFETY: the ring was allocated by `boxed`. The swap returned true: the other end has set `abandoned`, which
                // was its last access to the ring, and everything that it did before that is visible here.
                let mut ring = unsafe { alloc::boxed::Box::from_raw(self.ring.as_ptr()) };
                ring.drop_jobs();
            }
            return;
        }
        self.ring().control.0.abandoned.store(true, order::publish_abandoned());
    }
}

/// Two ends that own their ring together.
#[cfg(feature = "alloc")]
pub(crate) fn boxed<T>(capacity: usize, start: Position) -> (WriteEnd<T>, ReadEnd<T>) {
    use alloc::alloc::{Layout, alloc, handle_alloc_error};
    use core::ptr;

    let offset = core::mem::offset_of!(Ring<[Slot<T>; 0]>, slots);
    let layout = Layout::array::<Slot<T>>(capacity)
        .and_then(|slots| Layout::from_size_align(offset + slots.size(), align_of::<Ring<[Slot<T>; 0]>>()));
    #[expect(clippy::panic, reason = "as a vector does, for a size beyond the address space")]
    let Ok(layout) = layout else { panic!("capacity overflow") };
    let layout = layout.pad_to_align();
    // SAFETY: the layout is that of a ring of `capacity` slots, and its size is not zero. Every field is initialised before
    // the ring is used as one; the length of the slice is that of its slots.
    let mut ring = unsafe {
        let memory = alloc(layout);
        if memory.is_null() {
            handle_alloc_error(layout);
        }
        let ring = ptr::slice_from_raw_parts_mut(memory.cast::<Slot<T>>(), capacity) as *mut Ring<[Slot<T>]>;
        ptr::write(&raw mut (*ring).head, Padded(AtomicWord::new(start.into_word())));
        ptr::write(&raw mut (*ring).control, Padded(Control::new()));
        let slots = (&raw mut (*ring).slots).cast::<Slot<T>>();
        for index in 0..capacity {
            ptr::write(slots.add(index), Slot::new(start));
        }
        alloc::boxed::Box::from_raw(ring)
    };
    debug_assert_eq!(Layout::for_value(&*ring), layout);
    let (mut write, mut read) = ring.restart(start);
    // SAFETY: the leaked box is not used again; the ends that point to it are now its owners.
    let ring = unsafe { NonNull::new_unchecked(alloc::boxed::Box::into_raw(ring)) };
    (write.hold.ring, write.hold.owned) = (ring, true);
    (read.hold.ring, read.hold.owned) = (ring, true);
    (write, read)
}
