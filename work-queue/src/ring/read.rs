use core::fmt;

use super::{Hold, Ring, Slot};
use crate::position::{Position, Stamp};
use crate::sync::check;

/// The end that takes jobs and completes them.
pub(crate) struct ReadEnd<T> {
    pub(super) hold: Hold<T>,
    front: Front,
}

/// The reader's position.
#[derive(Debug)]
struct Front {
    head: Position,
    /// The position before which the head advances by a plain step: the end of its lap, or `NOWHERE` if `ahead` is not 0.
    plain_until: Position,
    /// How many slots after the head were completed out of order.
    ahead: usize,
    /// A copy of the ring's capacity, which only the slow path loads.
    capacity: usize,
}

// SAFETY: the end receives jobs from another thread, and by 1 to 4 never touches one that the other end owns.
unsafe impl<T: Send> Send for ReadEnd<T> {}

impl<T> ReadEnd<T> {
    pub(super) fn new(hold: Hold<T>, start: Position) -> Self {
        let capacity = hold.ring().capacity();
        let plain_until = start.end_of_lap(capacity);
        ReadEnd { hold, front: Front { head: start, plain_until, ahead: 0, capacity } }
    }

    /// The oldest job.
    #[inline(always)]
    pub(crate) fn take(&mut self) -> Option<Held<'_, T>> {
        if check::watermark_in_take() {
            self.apply_watermark();
        }
        let (ring, front) = (self.hold.ring(), &mut self.front);
        let position = front.head;
        // SAFETY: a head is the position of a slot.
        let slot = unsafe { ring.slot(position) };
        match slot.observe(position) {
            Stamp::Job(number) => Some(Held { ring, front, position, number, is_oldest: true }),
            _ => None, // by 5 it is free
        }
    }

    /// The oldest job for which `predicate` returns true.
    pub(crate) fn find(&mut self, mut predicate: impl FnMut(u16, &T) -> bool) -> Option<Held<'_, T>> {
        if check::watermark_in_find() {
            self.apply_watermark();
        }
        let (ring, front) = (self.hold.ring(), &mut self.front);
        let mut waiting = front.waiting(ring);
        let (position, number) = loop {
            let (position, number, job) = waiting.next()?;
            if predicate(number, job) {
                break (position, number);
            }
        };
        let is_oldest = position == front.head;
        Some(Held { ring, front, position, number, is_oldest })
    }

    /// The jobs that were not completed yet, oldest first; those that a reset discards are not among them.
    pub(crate) fn waiting(&self) -> Waiting<'_, T> {
        self.front.waiting(self.hold.ring())
    }

    pub(crate) fn capacity(&self) -> usize {
        self.hold.ring().capacity()
    }

    pub(crate) fn is_abandoned(&self) -> bool {
        self.hold.is_abandoned()
    }

    #[inline(always)]
    fn apply_watermark(&mut self) {
        let watermark = self.hold.ring().watermark();
        if self.front.head.is_before(watermark) {
            self.discard_before(watermark);
        }
    }

    #[cold]
    #[inline(never)]
    fn discard_before(&mut self, watermark: Position) {
        self.front.discard_before(watermark, self.hold.ring());
    }
}

impl Front {
    fn waiting<'a, T>(&self, ring: &'a Ring<[Slot<T>]>) -> Waiting<'a, T> {
        let watermark = ring.watermark();
        let position = if self.head.is_before(watermark) { watermark } else { self.head };
        Waiting { ring, position }
    }

    /// The acquire load of the watermark has taken over every slot before it: their stamps need no ordering of their own.
    fn discard_before<T>(&mut self, watermark: Position, ring: &Ring<[Slot<T>]>) {
        while self.head.is_before(watermark) {
            // SAFETY: a head is the position of a slot.
            let slot = unsafe { ring.slot(self.head) };
            match slot.observe_owned(self.head) {
                Stamp::Job(_) => {
                    // SAFETY: by 1 and 6 the slot is ours and its job initialised; the head moves over it.
                    let job = unsafe { slot.move_out() };
                    self.move_head(ring);
                    drop(job); // last: if it panics, it has been dropped once and the queue can be used on
                }
                // No job follows a free slot; by 5 a head is never at a completed one.
                Stamp::Completed | Stamp::Free => return,
            }
        }
    }

    /// Returns the slot at the head, and the completed slots that follow it, to the writer.
    #[inline(always)]
    fn move_head<T>(&mut self, ring: &Ring<[Slot<T>]>) {
        let next = self.head.step();
        if next.is_in_lap_before(self.plain_until) {
            self.head = next;
        } else {
            self.begin_lap_or_pass_completed(ring);
        }
        ring.set_head(self.head);
    }

    #[inline]
    fn begin_lap_or_pass_completed<T>(&mut self, ring: &Ring<[Slot<T>]>) {
        self.head = self.head.next(self.capacity);
        while self.ahead > 0 {
            // SAFETY: a head is the position of a slot.
            let slot = unsafe { ring.slot(self.head) };
            if slot.observe_owned(self.head) != Stamp::Completed {
                break;
            }
            self.ahead -= 1;
            self.head = self.head.next(self.capacity);
        }
        self.plain_until =
            if self.ahead == 0 { self.head.end_of_lap(self.capacity) } else { Position::NOWHERE };
    }
}

/// A job that is being executed. If this is dropped, the job waits as before.
pub(crate) struct Held<'a, T> {
    ring: &'a Ring<[Slot<T>]>,
    front: &'a mut Front,
    position: Position,
    number: u16,
    /// Whether `position` is the head.
    is_oldest: bool,
}

// SAFETY: as for the end, of which it is a part.
unsafe impl<T: Send> Send for Held<'_, T> {}

impl<T> Held<'_, T> {
    #[inline(always)]
    pub(crate) fn job(&self) -> &T {
        // SAFETY: the stamp had this lap, so by 1 the slot is ours and holds a job, and only `complete`, which takes `self`,
        // moves it out.
        self.slot().job.with(|job| unsafe { (*job).assume_init_ref() })
    }

    #[inline(always)]
    pub(crate) fn number(&self) -> u16 {
        self.number
    }

    /// Moves the job out and frees its slot, for the writer as soon as all before it are free too.
    #[inline(always)]
    pub(crate) fn complete(self) -> T {
        // SAFETY: as in `job`; below, the head moves over the slot or it is marked as completed.
        let job = unsafe { self.slot().move_out() };
        if self.is_oldest {
            self.front.head = self.position; // the same value: it lets the compiler use what it knows of `position`
            self.front.move_head(self.ring);
        } else {
            self.slot().mark_completed(self.position);
            self.front.ahead += 1;
            self.front.plain_until = Position::NOWHERE;
        }
        job
    }

    #[inline(always)]
    fn slot(&self) -> &Slot<T> {
        // SAFETY: a job was found there.
        unsafe { self.ring.slot(self.position) }
    }
}

/// See [`ReadEnd::waiting`].
pub(crate) struct Waiting<'a, T> {
    ring: &'a Ring<[Slot<T>]>,
    position: Position,
}

impl<'a, T> Waiting<'a, T> {
    /// Ends one lap after the head at the latest: the slot there has a stamp of the lap before, which reads as free.
    pub(crate) fn next(&mut self) -> Option<(Position, u16, &'a T)> {
        loop {
            let position = self.position;
            // SAFETY: it results from a head or a watermark by `Position::next`.
            let slot = unsafe { self.ring.slot(position) };
            match slot.observe(position) {
                Stamp::Job(number) => {
                    self.position = position.next(self.ring.capacity());
                    // SAFETY: the stamp has this lap, so by 1 the slot is the reader's and holds a job. Moving it out needs
                    // the end as `&mut`, which is borrowed here, or a `Held`, which does not exist yet.
                    let job = slot.job.with(|job| unsafe { (*job).assume_init_ref() });
                    return Some((position, number, job));
                }
                Stamp::Completed => self.position = position.next(self.ring.capacity()),
                Stamp::Free => return None,
            }
        }
    }
}

impl<T> fmt::Debug for ReadEnd<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.front.fmt(f)
    }
}
