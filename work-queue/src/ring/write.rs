use core::fmt;

use super::{Hold, Ring, Slot};
use crate::position::Position;

/// The end that fills slots.
pub(crate) struct WriteEnd<T> {
    pub(super) hold: Hold<T>,
    back: Back,
}

/// The writer's position.
#[derive(Debug)]
struct Back {
    /// The next slot to fill. Its index may be the capacity, until the next claim.
    tail: Position,
    /// The position at which the slow path must run: `space`, or the end of this lap.
    limit: Position,
    /// A head that was loaded, plus one lap.
    space: Position,
    watermark: Position,
}

// SAFETY: the end hands jobs to another thread, and by 1 to 4 never touches one that the other end owns.
unsafe impl<T: Send> Send for WriteEnd<T> {}

impl<T> WriteEnd<T> {
    pub(super) fn new(hold: Hold<T>, start: Position) -> Self {
        let limit = start.end_of_lap(hold.ring().capacity());
        WriteEnd { hold, back: Back { tail: start, limit, space: start.lap_after(), watermark: start } }
    }

    /// The next slot, if it is free.
    #[inline(always)]
    pub(crate) fn reserve(&mut self) -> Option<Reserved<'_, T>> {
        let (ring, back) = (self.hold.ring(), &mut self.back);
        if back.tail == back.limit && !back.begin_lap_or_load_head(ring) {
            return None;
        }
        Some(Reserved { ring, back })
    }

    /// Makes the reader discard every job queued until now.
    pub(crate) fn discard(&mut self) {
        self.back.set_watermark(self.tail(), self.hold.ring());
    }

    /// Whether the reader has completed or discarded every job from before the last [`discard`](Self::discard).
    pub(crate) fn is_settled(&self) -> bool {
        !self.hold.ring().head().is_before(self.back.watermark)
    }

    /// The slots that are free now.
    pub(crate) fn free(&self) -> usize {
        self.tail().distance_to(self.hold.ring().head().lap_after(), self.capacity())
    }

    pub(crate) fn capacity(&self) -> usize {
        self.hold.ring().capacity()
    }

    pub(crate) fn is_abandoned(&self) -> bool {
        self.hold.is_abandoned()
    }

    fn tail(&self) -> Position {
        self.back.tail.normalized(self.capacity())
    }
}

impl Back {
    /// Loads the head, which is in the other end's cache line, only if no space is left after the head loaded last. Returns
    /// whether there is space.
    #[inline]
    fn begin_lap_or_load_head<T>(&mut self, ring: &Ring<[Slot<T>]>) -> bool {
        let tail = self.tail.normalized(ring.capacity());
        if tail == self.space {
            // This happens at least once a lap: often enough to replace an old watermark before it is half of all laps old
            // and compares as newer than the tail.
            if self.watermark.is_stale_at(tail) {
                self.set_watermark(tail.lap_before(), ring);
            }
            self.space = ring.head().lap_after();
        }
        self.tail = tail;
        self.limit = self.space.or_end_of_lap(tail, ring.capacity());
        tail != self.limit
    }

    fn set_watermark<T>(&mut self, watermark: Position, ring: &Ring<[Slot<T>]>) {
        self.watermark = watermark;
        ring.set_watermark(watermark);
    }
}

/// The slot at the tail, which is the writer's.
pub(crate) struct Reserved<'a, T> {
    ring: &'a Ring<[Slot<T>]>,
    back: &'a mut Back,
}

// SAFETY: as for the end, of which it is a part.
unsafe impl<T: Send> Send for Reserved<'_, T> {}

impl<T> Reserved<'_, T> {
    /// Fills the slot with what `job` returns, and hands it to the reader.
    #[inline(always)]
    pub(crate) fn fill(self, number: u16, job: impl FnOnce() -> T) {
        let tail = self.back.tail;
        // SAFETY: `reserve` has checked that the tail is before `limit`, so it is the position of a slot.
        let slot = unsafe { self.ring.slot(tail) };
        // SAFETY: by 2 and 4 this slot is ours and holds no job.
        slot.job.with_mut(|place| unsafe { (*place).write(job()) });
        slot.publish(tail.stamp(number));
        self.back.tail = tail.step();
    }
}

impl<T> fmt::Debug for WriteEnd<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.back.fmt(f)
    }
}
