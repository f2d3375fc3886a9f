use core::fmt;
use core::marker::PhantomData;
use core::ops::{Deref, DerefMut};

use super::{End, Hold};
use crate::cursor::{Cursor, Mark};
use crate::sync::{Ordering::Relaxed, check};
use crate::wake::{NoWake, Wake};

/// The end of the motion task: takes jobs, executes them, completes them. There is one for each queue.
///
/// Nothing here ever waits for the writer.
pub struct Reader<'q, T, W: Wake = NoWake> {
    end: End<T, W>,
    front: Front,
    storage: PhantomData<&'q mut ()>,
}

/// The place of the reader.
#[derive(Debug, Clone, Copy)]
struct Front {
    cursor: Cursor,
    /// The last reset mark that the reader has applied.
    mark: Mark,
    /// The number of jobs after the cursor that were completed before their turn.
    ahead: u32,
}

impl<T, W: Wake> Reader<'_, T, W> {
    pub(super) fn new(hold: Hold<T>, cursor: Cursor, writer: W) -> Self {
        let front = Front { cursor, mark: hold.mark(), ahead: 0 };
        Reader { end: End { hold, other: writer }, front, storage: PhantomData }
    }

    /// Takes the oldest job, by reference; `None` if there is none yet.
    #[inline(always)]
    pub fn take(&mut self) -> Option<TakenJob<'_, T, W>> {
        if !self.front.find(&self.end.hold, &self.end.other, check::mark_in_take()) {
            return None;
        }
        let here = self.front.cursor;
        Some(TakenJob { hold: self.end.hold, front: &mut self.front, here, writer: &self.end.other })
    }

    /// Takes the oldest jobs, at most `most`, by reference: fewer if fewer were published when the reader last ran out of
    /// jobs, or if the lap, the numbers, or a job that was completed before its turn end the row. They are completed together.
    #[inline(always)]
    pub fn take_batch(&mut self, most: usize) -> Option<TakenBatch<'_, T, W>> {
        if most == 0 || !self.front.find(&self.end.hold, &self.end.other, check::mark_in_batch()) {
            return None;
        }
        let row = self.front.cursor.row(self.end.hold.limits());
        #[expect(clippy::cast_possible_truncation, reason = "no more than the row")]
        let row = most.min(row as usize) as u32;
        Some(TakenBatch { hold: self.end.hold, front: &mut self.front, row, writer: &self.end.other })
    }

    /// Takes the oldest job for which `predicate` returns true; its arguments are the number and the job. The job overtakes those
    /// before it.
    ///
    /// For applications in which the order of jobs does not matter. The slot of a job completed out of order becomes free when
    /// all before it are completed. In the worst case every waiting job is examined.
    pub fn take_where(&mut self, mut predicate: impl FnMut(u16, &T) -> bool) -> Option<TakenJob<'_, T, W>> {
        self.front.cursor.end = self.end.hold.tail();
        if !self.front.find(&self.end.hold, &self.end.other, check::mark_in_find()) {
            return None;
        }
        let mut waiting = self.front.waiting(&self.end.hold);
        while let Some(here) = waiting.step() {
            if predicate(here.number(), waiting.job(here)) {
                return Some(TakenJob {
                    hold: self.end.hold,
                    front: &mut self.front,
                    here,
                    writer: &self.end.other,
                });
            }
        }
        None
    }

    /// Returns the waiting jobs with their numbers, oldest first.
    pub fn iter(&self) -> Iter<'_, T> {
        let mut front = self.front;
        let (tail, limits) = (self.end.hold.tail(), self.end.hold.limits());
        let mark = self.end.hold.mark();
        if mark != front.mark
            && let Ok(ahead) = u32::try_from(mark.ahead_of(front.cursor.at))
        {
            front.cursor = Cursor::new(limits.after(front.cursor.at, ahead), mark.number(), limits);
        }
        // The mark may be of a reset after the jobs up to the tail.
        front.cursor.end = if limits.is_before(tail, front.cursor.at) { front.cursor.at } else { tail };
        front.waiting(&self.end.hold)
    }

    /// Returns the number of waiting jobs.
    pub fn len(&self) -> usize {
        let waiting = self.iter();
        match self.front.ahead {
            0 => self.end.hold.limits().distance(waiting.cursor.at, waiting.cursor.end) as usize,
            _ => waiting.count(),
        }
    }

    /// Returns whether no jobs wait.
    pub fn is_empty(&self) -> bool {
        self.iter().next().is_none()
    }

    /// Returns the capacity of the queue in jobs: `1..=9999`.
    pub fn capacity(&self) -> usize {
        self.end.hold.limits().capacity as usize
    }

    /// Returns whether the writer is gone. If [`take`](Self::take) returns `None` *after* this returned true, it always
    /// will.
    pub fn is_abandoned(&self) -> bool {
        self.end.hold.is_abandoned()
    }
}

impl Front {
    /// Returns whether a job waits. Reads the tail if no job is known, then the mark: in this sequence no job is found
    /// before the marks that were stored before it.
    #[inline(always)]
    fn find<T>(&mut self, hold: &Hold<T>, writer: &impl Wake, obeys: bool) -> bool {
        if !self.look(hold) {
            return false;
        }
        let mark = hold.mark();
        if mark == self.mark || !obeys {
            return true;
        }
        self.obey(*hold, mark, writer)
    }

    #[inline(always)]
    fn look<T>(&mut self, hold: &Hold<T>) -> bool {
        if !self.cursor.is_open() {
            self.cursor.end = hold.tail();
        }
        self.cursor.is_open()
    }

    fn waiting<'a, T>(&self, hold: &'a Hold<T>) -> Iter<'a, T> {
        Iter { hold, cursor: self.cursor, skips: self.ahead > 0 }
    }

    /// Returns whether the job at the cursor was completed before its turn, which is now.
    fn passes<T>(&mut self, hold: Hold<T>) -> bool {
        let done = hold.done(&self.cursor);
        let passes = self.ahead > 0 && done.load(Relaxed);
        if passes {
            done.store(false, Relaxed);
            self.ahead -= 1;
        }
        passes
    }

    /// Frees the slots of executed jobs.
    #[inline(always)]
    fn free<T>(&mut self, hold: Hold<T>, jobs: u32) {
        if self.cursor.advance(jobs) {
            self.turn(hold);
        } else {
            hold.set_head(self.cursor.at);
        }
    }

    /// Turns, passes the slots that were completed before their turn, and frees them. While there are any, each step turns.
    #[cold]
    #[inline(never)]
    fn turn<T>(&mut self, hold: Hold<T>) {
        self.cursor.turn(hold.limits());
        while self.cursor.is_open() && self.passes(hold) {
            self.cursor.step(hold.limits());
        }
        if self.ahead > 0 {
            self.cursor.stop = self.cursor.at + 1;
        }
        hold.set_head(self.cursor.at);
    }

    /// Discards the jobs before the mark, numbers those after it, and returns whether one waits. The cursor is open.
    #[cold]
    #[inline(never)]
    fn obey<T>(&mut self, hold: Hold<T>, mut mark: Mark, writer: &impl Wake) -> bool {
        while mark != self.mark {
            let ahead = mark.ahead_of(self.cursor.at);
            let mut job = None;
            if ahead > 0 {
                if !self.passes(hold) {
                    // SAFETY: the cursor is open, so the slot is the reader's, and by 1 it contains a job; the cursor moves
                    // over it.
                    job = Some(unsafe { hold.slot(&self.cursor).place().read() });
                }
                self.cursor.step(hold.limits());
                hold.set_head(self.cursor.at);
            } else {
                self.mark = mark;
                if ahead == 0 {
                    self.cursor.number_from(mark.number(), hold.limits());
                }
                self.turn(hold);
            }
            writer.wake();
            drop(job); // last: should it panic, it has been dropped once and the queue can be used on
            if !self.look(&hold) {
                return false;
            }
            mark = hold.mark();
        }
        true
    }
}

impl<T, W: Wake> fmt::Debug for Reader<'_, T, W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Reader").field("front", &self.front).finish_non_exhaustive()
    }
}

impl<'a, T, W: Wake> IntoIterator for &'a Reader<'_, T, W> {
    type Item = (u16, &'a T);
    type IntoIter = Iter<'a, T>;

    fn into_iter(self) -> Iter<'a, T> {
        self.iter()
    }
}

/// A job that is being executed, in its slot. A reset does not discard it.
///
/// Only [`complete`](Self::complete) frees the slot. If the guard is dropped without it, the job waits again; if the job was
/// the oldest, [`Reader::take`] returns it next, unless a reset has discarded it meanwhile. The guard dereferences to the
/// job: a job's own method with the name `number` or `complete` is `(*taken).number()`.
#[must_use = "a job that is not completed waits again"]
pub struct TakenJob<'a, T, W: Wake = NoWake> {
    hold: Hold<T>,
    front: &'a mut Front,
    here: Cursor,
    writer: &'a W,
}

impl<T, W: Wake> TakenJob<'_, T, W> {
    /// Returns the number of the job: `1..=max_number`.
    #[inline(always)]
    pub fn number(&self) -> u16 {
        self.here.number()
    }

    /// Frees the slot of the executed job and returns the job.
    #[inline(always)]
    pub fn complete(self) -> T {
        let (hold, front) = (self.hold, self.front);
        // SAFETY: as in `deref`; below, the cursor moves over the slot or its flag is set.
        let job = unsafe { hold.slot(&self.here).place().read() };
        if self.here.at == front.cursor.at {
            front.free(hold, 1);
        } else {
            hold.done(&self.here).store(true, Relaxed);
            front.ahead += 1;
            front.cursor.stop = front.cursor.at + 1;
        }
        self.writer.wake();
        job
    }
}

impl<T, W: Wake> Deref for TakenJob<'_, T, W> {
    type Target = T;

    #[inline(always)]
    fn deref(&self) -> &T {
        // SAFETY: a job was found there, and only `complete`, which takes `self`, moves it out.
        unsafe { &*self.hold.slot(&self.here).place() }
    }
}

impl<T, W: Wake> DerefMut for TakenJob<'_, T, W> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut T {
        // SAFETY: as in `deref`.
        unsafe { &mut *self.hold.slot(&self.here).place() }
    }
}

impl<T: fmt::Debug, W: Wake> fmt::Debug for TakenJob<'_, T, W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Taken").field("number", &self.number()).field("job", &**self).finish()
    }
}

/// Jobs that are being executed, in their slots, and completed together. A reset does not discard them.
///
/// If this is dropped without [`complete`](Self::complete), the jobs wait again.
#[must_use = "jobs that are not completed wait again"]
pub struct TakenBatch<'a, T, W: Wake = NoWake> {
    hold: Hold<T>,
    front: &'a mut Front,
    /// The number of jobs from the cursor on: up to its stop.
    row: u32,
    writer: &'a W,
}

impl<T, W: Wake> TakenBatch<'_, T, W> {
    /// Returns the jobs with their numbers, oldest first; at least one.
    #[inline(always)]
    pub fn iter_mut(&mut self) -> impl ExactSizeIterator<Item = (u16, &mut T)> {
        let first = self.front.cursor.number();
        let slots = self.hold.row(&self.front.cursor, self.row);
        slots.iter().enumerate().map(move |(offset, slot)| {
            #[expect(clippy::cast_possible_truncation, reason = "a row is not longer than the numbers")]
            let number = first + offset as u16;
            // SAFETY: the slots of the row are the reader's and contain jobs; each is lent once.
            (number, unsafe { &mut *slot.place() })
        })
    }

    /// Frees the slots of the executed jobs at once, and drops the jobs.
    #[inline(always)]
    pub fn complete(self) {
        let FreeOnDrop(batch) = &FreeOnDrop(self);
        if core::mem::needs_drop::<T>() {
            for slot in batch.hold.row(&batch.front.cursor, batch.row) {
                // SAFETY: as in `iter_mut`; they are freed then. If a drop panics, the others are leaked.
                drop(unsafe { slot.place().read() });
            }
        }
    }
}

/// Frees the slots when it is dropped, even if the drop of a job panics: these jobs are not found again.
struct FreeOnDrop<'a, T, W: Wake>(TakenBatch<'a, T, W>);

impl<T, W: Wake> Drop for FreeOnDrop<'_, T, W> {
    #[inline(always)]
    fn drop(&mut self) {
        self.0.front.free(self.0.hold, self.0.row);
        self.0.writer.wake();
    }
}

impl<T, W: Wake> fmt::Debug for TakenBatch<'_, T, W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TakenBatch").field("jobs", &self.row).finish_non_exhaustive()
    }
}

/// The waiting jobs of a [`Reader`] with their numbers, oldest first.
pub struct Iter<'a, T> {
    hold: &'a Hold<T>,
    cursor: Cursor,
    skips: bool,
}

impl<'a, T> Iter<'a, T> {
    /// Advances to the next job that was not completed.
    fn step(&mut self) -> Option<Cursor> {
        while self.cursor.is_open() {
            let here = self.cursor;
            self.cursor.step(self.hold.limits());
            if !self.skips || !self.hold.done(&here).load(Relaxed) {
                return Some(here);
            }
        }
        None
    }

    fn job(&self, here: Cursor) -> &'a T {
        // SAFETY: by 1 and 4 the slot is the reader's and contains a job; to move it out takes the reader as `&mut`.
        unsafe { &*self.hold.slot(&here).place() }
    }
}

impl<'a, T> Iterator for Iter<'a, T> {
    type Item = (u16, &'a T);

    fn next(&mut self) -> Option<Self::Item> {
        self.step().map(|here| (here.number(), self.job(here)))
    }
}

impl<T> fmt::Debug for Iter<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Iter").finish_non_exhaustive()
    }
}
