//! The slots, and all of the `unsafe` code: who owns each slot, and which store hands it over.
//!
//! # The invariant
//!
//! `capacity` slots stand in a ring. A [`Position`] names one slot on one lap. Three positions follow one another, never more
//! than a lap apart:
//!
//! ```text
//!    head                        tail                   head + 1 lap
//!     |  published: the READER's  |  free: the WRITER's  |
//! ```
//!
//! 1. The slots from `head` to `tail` belong to the reader: their stamp is of their position's lap. Unless the number in
//!    the stamp is 0, their job is initialised. The reader reads the job, moves it out, and may rewrite the stamp.
//! 2. The slots from `tail` to `head` + 1 lap belong to the writer: their stamp is of the lap before, their job is not
//!    initialised. The writer writes the job, then the stamp.
//! 3. `tail` is the writer's own and is stored nowhere. The release store of a **stamp** of this lap moves it over one slot
//!    and hands that slot to the reader, whose acquire load of the same stamp takes it over.
//! 4. `head` is stored by the reader alone. The release store of **head** hands every slot before it back to the writer,
//!    whose acquire load of `head` takes them over. The writer knows `limit`, a `head` that it has seen, plus one lap: the
//!    slots from `tail` to `limit` are certainly its own, and at `tail == limit` it must look at `head` again.
//! 5. A job completed out of order is moved out, and 0, which is no job number, is put into its stamp: the slot remains the
//!    reader's. `head` moves over such slots, `ahead` of them, when it reaches them, and never rests on one.
//! 6. The **watermark** is stored by the writer alone, and is a `tail` of the past: the release store tells the reader, whose
//!    acquire load takes over every slot before it, to discard them. It never lies behind `tail` by half of all laps.
//! 7. There is one [`WriteEnd`] and one [`ReadEnd`]. With borrowed storage the lifetime of their owners says that the ring
//!    outlives both. With owned storage whoever is second to set `abandoned` drops and frees the ring.

use core::fmt;
use core::mem::MaybeUninit;
use core::num::NonZeroU16;
use core::ptr::NonNull;

use crate::position::Position;
use crate::sync::{AtomicBool, AtomicWord, Ordering, UnsafeCell, order};

/// Keeps what one end writes off the cache lines that the other reads: two lines, because processors fetch them in pairs.
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

/// What is seldom written, so that looking at it costs no transfer.
struct Control {
    watermark: AtomicWord,
    abandoned: AtomicBool,
}

/// A job of 56 bytes fills one cache line with its stamp.
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
}

impl<T> Ring<[Slot<T>]> {
    /// Drops the jobs that are left and makes two ends that begin at `start`.
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
        let limit = start.lap_after();
        (
            WriteEnd { hold: hold(), tail: start, limit, watermark: start },
            ReadEnd { hold: hold(), head: start, ahead: 0 },
        )
    }

    /// Drops the jobs between `head` and `tail`: `&mut` says that neither end is left to do it.
    pub(crate) fn drop_jobs(&mut self) {
        let mut position = Position::from_word(self.head.0.load(Ordering::Relaxed));
        for _ in 0..self.slots.len() {
            let Some(slot) = self.slots.get(position.index()) else { return };
            let Some(number) = position.number_in(slot.stamp.load(Ordering::Relaxed)) else { return };
            if number != 0 {
                slot.stamp.store(position.stamp(0), Ordering::Relaxed); // first: a panicking drop must not run twice
                // SAFETY: by 1 the job is initialised; by `&mut self` it is ours alone; the stamp says that it is gone.
                slot.job.with_mut(|job| unsafe { (*job).assume_init_drop() });
            }
            position = position.next(self.slots.len());
        }
    }
}

/// A pointer to the ring: half of what keeps it alive.
struct Hold<T> {
    ring: NonNull<Ring<[Slot<T>]>>,
    #[cfg(feature = "alloc")]
    owned: bool,
}

impl<T> Hold<T> {
    #[inline(always)]
    fn ring(&self) -> &Ring<[Slot<T>]> {
        // SAFETY: by 7 the ring outlives this hold, and nobody has it as `&mut` as long as there is one.
        unsafe { self.ring.as_ref() }
    }

    #[inline(always)]
    fn capacity(&self) -> usize {
        self.ring().slots.len()
    }

    #[inline(always)]
    fn slot(&self, position: Position) -> &Slot<T> {
        let slots = &self.ring().slots;
        debug_assert!(position.index() < slots.len());
        // SAFETY: `Position::next` keeps the index below the capacity, and every position comes from it.
        unsafe { slots.get_unchecked(position.index()) }
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
                // SAFETY: the ring came from `boxed`; the swap says that the other end has set `abandoned` before, which was
                // the last thing that it did with the ring, and has made everything before that visible here.
                let mut ring = unsafe { alloc::boxed::Box::from_raw(self.ring.as_ptr()) };
                ring.drop_jobs();
            }
            return;
        }
        self.ring().control.0.abandoned.store(true, order::publish_abandoned());
    }
}

/// The end that fills slots.
pub(crate) struct WriteEnd<T> {
    hold: Hold<T>,
    tail: Position,
    limit: Position,
    watermark: Position,
}

// SAFETY: the end hands jobs to another thread, and by 1 to 4 never touches one that the other end owns.
unsafe impl<T: Send> Send for WriteEnd<T> {}

impl<T> WriteEnd<T> {
    /// The next slot, if it is free.
    #[inline(always)]
    pub(crate) fn reserve(&mut self) -> Option<Reserved<'_, T>> {
        if self.tail == self.limit && !self.look_for_space() { None } else { Some(Reserved { end: self }) }
    }

    /// Reads the other end's cache line. Runs at least once a lap, so it is also the place to keep the watermark from
    /// falling half of all laps behind, where it would seem to lie ahead.
    #[inline]
    fn look_for_space(&mut self) -> bool {
        if self.tail.has_left_behind(self.watermark) {
            self.set_watermark(self.tail.lap_before());
        }
        self.limit = self.head().lap_after();
        self.tail != self.limit
    }

    /// Tells the reader to discard every job queued until now.
    pub(crate) fn discard(&mut self) {
        self.set_watermark(self.tail);
    }

    fn set_watermark(&mut self, watermark: Position) {
        self.watermark = watermark;
        self.hold.ring().control.0.watermark.store(watermark.into_word(), order::publish_watermark());
    }

    /// Whether the reader has completed or discarded every job from before the last [`discard`](Self::discard).
    pub(crate) fn is_settled(&self) -> bool {
        !self.head().is_before(self.watermark)
    }

    /// The slots that are free now.
    pub(crate) fn free(&self) -> usize {
        self.tail.distance_to(self.head().lap_after(), self.capacity())
    }

    pub(crate) fn capacity(&self) -> usize {
        self.hold.capacity()
    }

    pub(crate) fn is_abandoned(&self) -> bool {
        self.hold.is_abandoned()
    }

    #[inline]
    fn head(&self) -> Position {
        Position::from_word(self.hold.ring().head.0.load(order::observe_head()))
    }
}

/// The slot at the tail, which is the writer's.
pub(crate) struct Reserved<'a, T> {
    end: &'a mut WriteEnd<T>,
}

impl<T> Reserved<'_, T> {
    /// Fills the slot with what `job` returns, and hands it to the reader.
    #[inline(always)]
    pub(crate) fn fill(self, number: NonZeroU16, job: impl FnOnce() -> T) {
        let end = self.end;
        let slot = end.hold.slot(end.tail);
        // SAFETY: `reserve` has seen that the tail is before `limit`, so by 2 and 4 the slot is ours and holds no job.
        slot.job.with_mut(|place| unsafe { (*place).write(job()) });
        slot.stamp.store(end.tail.stamp(number.get()), order::publish_stamp());
        end.tail = end.tail.next(end.hold.capacity());
    }
}

/// The end that takes jobs and completes them.
pub(crate) struct ReadEnd<T> {
    hold: Hold<T>,
    head: Position,
    /// How many slots behind `head` were completed out of order.
    ahead: usize,
}

// SAFETY: the end receives jobs from another thread, and by 1 to 4 never touches one that the other end owns.
unsafe impl<T: Send> Send for ReadEnd<T> {}

impl<T> ReadEnd<T> {
    /// The oldest job.
    #[inline(always)]
    pub(crate) fn take(&mut self) -> Option<Held<'_, T>> {
        self.obey_watermark();
        let position = self.head;
        let number = NonZeroU16::new(self.number_at(position)?)?;
        Some(Held { end: self, position, number })
    }

    /// The oldest job that is `wanted`.
    pub(crate) fn find(&mut self, mut wanted: impl FnMut(u16, &T) -> bool) -> Option<Held<'_, T>> {
        self.obey_watermark();
        let mut waiting = self.waiting();
        let (position, number) = loop {
            let (position, number, job) = waiting.next()?;
            if wanted(number.get(), job) {
                break (position, number);
            }
        };
        Some(Held { end: self, position, number })
    }

    /// The jobs that were not completed yet, oldest first; those that a reset discards are not among them.
    pub(crate) fn waiting(&self) -> Waiting<'_, T> {
        let watermark = self.watermark();
        let position = if self.head.is_before(watermark) { watermark } else { self.head };
        Waiting { end: self, position, end_of_lap: self.head.lap_after() }
    }

    pub(crate) fn capacity(&self) -> usize {
        self.hold.capacity()
    }

    pub(crate) fn is_abandoned(&self) -> bool {
        self.hold.is_abandoned()
    }

    #[inline(always)]
    fn watermark(&self) -> Position {
        Position::from_word(self.hold.ring().control.0.watermark.load(order::observe_watermark()))
    }

    #[inline(always)]
    fn obey_watermark(&mut self) {
        let watermark = self.watermark();
        if self.head.is_before(watermark) {
            self.discard_before(watermark);
        }
    }

    /// The acquire load of the watermark has taken over every slot before it: their stamps need no ordering of their own.
    #[cold]
    fn discard_before(&mut self, watermark: Position) {
        while self.head.is_before(watermark) {
            match self.head.number_in(self.hold.slot(self.head).stamp.load(Ordering::Relaxed)) {
                Some(0) => {
                    self.ahead -= 1;
                    self.move_head();
                }
                Some(_) => {
                    // SAFETY: the slot is ours and its number is not 0, so by 1 its job is initialised; `head` moves over it.
                    let job = unsafe { self.move_out(self.head) };
                    self.move_head();
                    drop(job); // last: should it panic, it has been dropped once and the queue goes on
                }
                None => return,
            }
        }
    }

    /// Gives the slot at `head`, and those behind it that were completed before, back to the writer.
    #[inline(always)]
    fn move_head(&mut self) {
        self.head = self.head.next(self.capacity());
        if self.ahead > 0 {
            self.move_head_over_completed();
        }
        self.hold.ring().head.0.store(self.head.into_word(), order::publish_head());
    }

    fn move_head_over_completed(&mut self) {
        while self.ahead > 0
            && self.head.number_in(self.hold.slot(self.head).stamp.load(Ordering::Relaxed)) == Some(0)
        {
            self.ahead -= 1;
            self.head = self.head.next(self.capacity());
        }
    }

    /// The number of the job at a position from `head` to `head` + 1 lap: 0 if it was completed, `None` if there is none yet.
    #[inline(always)]
    fn number_at(&self, position: Position) -> Option<u16> {
        position.number_in(self.hold.slot(position).stamp.load(order::observe_stamp()))
    }

    /// # Safety
    ///
    /// The slot is the reader's, and holds a job, which is moved out: the caller moves `head` over the slot or puts a 0 in it.
    #[inline(always)]
    unsafe fn move_out(&self, position: Position) -> T {
        // SAFETY: as above.
        self.hold.slot(position).job.with(|job| unsafe { (*job).assume_init_read() })
    }
}

/// A job that is being executed. Dropped, it waits as before.
pub(crate) struct Held<'a, T> {
    end: &'a mut ReadEnd<T>,
    position: Position,
    number: NonZeroU16,
}

impl<T> Held<'_, T> {
    #[inline(always)]
    pub(crate) fn job(&self) -> &T {
        // SAFETY: the stamp had this lap and a number, so by 1 the slot is ours and holds a job, and only `complete`, which
        // takes `self`, moves it out.
        self.end.hold.slot(self.position).job.with(|job| unsafe { (*job).assume_init_ref() })
    }

    #[inline(always)]
    pub(crate) fn number(&self) -> NonZeroU16 {
        self.number
    }

    /// Moves the job out and frees its slot, for the writer as soon as all before it are free too.
    #[inline(always)]
    pub(crate) fn complete(self) -> T {
        // SAFETY: as in `job`; below, `head` moves over the slot or it is marked with a 0.
        let job = unsafe { self.end.move_out(self.position) };
        if self.position == self.end.head {
            self.end.move_head();
        } else {
            self.end.hold.slot(self.position).stamp.store(self.position.stamp(0), Ordering::Relaxed);
            self.end.ahead += 1;
        }
        job
    }
}

/// See [`ReadEnd::waiting`].
pub(crate) struct Waiting<'a, T> {
    end: &'a ReadEnd<T>,
    position: Position,
    end_of_lap: Position,
}

impl<'a, T> Waiting<'a, T> {
    pub(crate) fn next(&mut self) -> Option<(Position, NonZeroU16, &'a T)> {
        while self.position != self.end_of_lap {
            let position = self.position;
            let number = self.end.number_at(position)?;
            self.position = position.next(self.end.capacity());
            if let Some(number) = NonZeroU16::new(number) {
                // SAFETY: the stamp has this lap and a number, so by 1 the slot is the reader's and holds a job; moving it out
                // takes the end as `&mut`, which is borrowed here.
                let job = self.end.hold.slot(position).job.with(|job| unsafe { (*job).assume_init_ref() });
                return Some((position, number, job));
            }
        }
        None
    }
}

/// Two ends that own their ring together.
#[cfg(feature = "alloc")]
pub(crate) fn boxed<T>(capacity: usize, start: Position) -> (WriteEnd<T>, ReadEnd<T>) {
    use alloc::alloc::{Layout, alloc, handle_alloc_error};
    use core::ptr;

    type Ends<T> = (WriteEnd<T>, ReadEnd<T>);
    let offset = core::mem::offset_of!(Ring<[Slot<T>; 0]>, slots);
    let layout = Layout::array::<Slot<T>>(capacity)
        .and_then(|slots| Layout::from_size_align(offset + slots.size(), align_of::<Ring<[Slot<T>; 0]>>()));
    #[expect(clippy::panic, reason = "as for a vector, a size beyond the address space cannot be asked for")]
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
    let (mut write, mut read): Ends<T> = ring.restart(start);
    // SAFETY: the leaked box is not used again; the ends that point to it are now its owners.
    let ring = unsafe { NonNull::new_unchecked(alloc::boxed::Box::into_raw(ring)) };
    (write.hold.ring, write.hold.owned) = (ring, true);
    (read.hold.ring, read.hold.owned) = (ring, true);
    (write, read)
}

impl<T> fmt::Debug for WriteEnd<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("WriteEnd")
            .field("tail", &self.tail)
            .field("limit", &self.limit)
            .finish_non_exhaustive()
    }
}

impl<T> fmt::Debug for ReadEnd<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ReadEnd")
            .field("head", &self.head)
            .field("ahead", &self.ahead)
            .finish_non_exhaustive()
    }
}
