use core::fmt;
use core::marker::PhantomData;

use super::{End, Hold};
use crate::cursor::{Cursor, Mark};
use crate::error::{Full, NumberError};
use crate::wake::{NoWake, Wake};

/// The end of the communication task: queues jobs, in the order of their numbers. There is one for each queue.
///
/// For each job of a packet: [`claim`](Self::claim) a slot, decode the job, [`commit`](Claim::commit) it; or do so in a
/// [`claim_batch`](Self::claim_batch), whose jobs are published at once. When the queue is [`Full`], discard the rest of the
/// packet, wait until it has [`drained`](Self::drained), and request a resend from the job after
/// [`last_number`](Self::last_number).
///
/// Nothing here ever waits for the reader.
pub struct Writer<'q, T, R: Wake = NoWake> {
    end: End<T, R>,
    cursor: Cursor,
    storage: PhantomData<&'q mut ()>,
}

impl<T, R: Wake> Writer<'_, T, R> {
    pub(super) fn new(hold: Hold<T>, mut cursor: Cursor, reader: R) -> Self {
        let limits = hold.limits();
        cursor.end = limits.after(cursor.at, limits.capacity);
        Writer { end: End { hold, other: reader }, cursor, storage: PhantomData }
    }

    /// Claims the next slot. A full queue is reported here, before a job is decoded and before its number is checked.
    ///
    /// # Errors
    ///
    /// [`Full`] if every slot contains a job that was not completed yet.
    #[inline(always)]
    pub fn claim(&mut self) -> Result<Claim<'_, T, R>, Full> {
        if !self.cursor.is_open() && self.look() == 0 {
            return Err(Full);
        }
        Ok(Claim { hold: self.end.hold, cursor: &mut self.cursor, publish: Some(&self.end.other) })
    }

    /// Claims this many slots. The jobs in them are published together.
    ///
    /// # Errors
    ///
    /// [`Full`] if fewer are free.
    #[inline(always)]
    pub fn claim_batch(&mut self, slots: usize) -> Result<Batch<'_, T, R>, Full> {
        let limits = self.end.hold.limits();
        let known = limits.distance(self.cursor.at, self.cursor.end) as usize;
        if slots > known && self.look() < slots {
            return Err(Full);
        }
        #[expect(clippy::cast_possible_truncation, reason = "no more than the capacity")]
        let slots = slots as u32;
        let (start, end) = (self.cursor.at, limits.after(self.cursor.at, slots));
        Ok(Batch {
            hold: self.end.hold,
            cursor: &mut self.cursor,
            start,
            end,
            slots,
            reader: &self.end.other,
        })
    }

    /// Looks how many slots are free.
    #[inline(always)]
    fn look(&mut self) -> usize {
        let (head, limits) = (self.end.hold.head(), self.end.hold.limits());
        self.cursor.end = limits.after(head, limits.capacity);
        (limits.capacity - limits.distance(head, self.cursor.at)) as usize
    }

    /// Discards every job that is queued now; the numbering continues.
    ///
    /// The reader discards them when it next takes a job. A job that it is executing is not discarded, and one more may
    /// still start until the writer [`is_settled`](Self::is_settled). Jobs queued from now on stay.
    pub fn clear(&mut self) {
        self.end.hold.set_mark(Mark::new(self.cursor.at, self.cursor.number()));
        self.end.other.wake();
    }

    /// Discards every job that is queued now, as [`clear`](Self::clear) does, and restarts the numbering: the next job is 1.
    pub fn reset(&mut self) {
        self.cursor.number_from(1, self.end.hold.limits());
        self.clear();
    }

    /// Returns whether the last [`clear`](Self::clear) or [`reset`](Self::reset) has taken effect: no job from before it is
    /// still queued or being executed. Also true if neither was ever called.
    pub fn is_settled(&self) -> bool {
        self.end.hold.mark().ahead_of(self.end.hold.head()) <= 0
    }

    /// Returns the number that the next job must have: `1..=max_number`.
    pub fn next_number(&self) -> u16 {
        self.cursor.number()
    }

    /// Returns the number of the job queued last; `None` before the first, never 0.
    pub fn last_number(&self) -> Option<u16> {
        self.cursor.last(self.end.hold.limits())
    }

    /// Returns the highest job number: 1 follows it.
    pub fn max_number(&self) -> u16 {
        self.end.hold.limits().max
    }

    /// Returns the capacity of the queue in jobs: `1..=9999`.
    pub fn capacity(&self) -> usize {
        self.end.hold.limits().capacity as usize
    }

    /// Returns the number of occupied slots, including that of the job being executed. A slot completed out of order
    /// is occupied until all before it are completed too.
    pub fn len(&self) -> usize {
        self.end.hold.limits().distance(self.end.hold.head(), self.cursor.at) as usize
    }

    /// Returns whether all slots are free.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the number of free slots.
    pub fn free(&self) -> usize {
        self.capacity() - self.len()
    }

    /// Returns whether all slots are taken.
    pub fn is_full(&self) -> bool {
        self.free() == 0
    }

    /// Returns whether the queue has at most `low_water` jobs, including the one being executed.
    ///
    /// Wait for this after [`Full`], not for one free slot: then the missing jobs are sent as a whole batch, and the reader's
    /// progress is read once for all of them.
    pub fn drained(&self, low_water: usize) -> bool {
        self.len() <= low_water
    }

    /// Returns whether the reader is gone: jobs queued now are never executed.
    pub fn is_abandoned(&self) -> bool {
        self.end.hold.is_abandoned()
    }
}

/// Turns a cursor of the writer's, renews an old mark, and publishes the jobs before the cursor.
///
/// Inline, so that a loop keeps the cursor in registers: no call is given its address.
#[inline(always)]
fn turn<T>(hold: Hold<T>, cursor: &mut Cursor, publish: bool) {
    cursor.turn(hold.limits());
    if hold.mark().is_stale(cursor.at) {
        return renew(hold, cursor.at, cursor.number(), publish);
    }
    if publish {
        hold.set_tail(cursor.at);
    }
}

/// Puts the mark at the head, at which it discards no jobs.
#[cold]
#[inline(never)]
fn renew<T>(hold: Hold<T>, at: u32, number: u16, publish: bool) {
    let (head, limits) = (hold.head(), hold.limits());
    hold.set_mark(Mark::new(head, Cursor::new(at, number, limits).back_at(head, limits).number()));
    if publish {
        hold.set_tail(at);
    }
}

impl<T, R: Wake> fmt::Debug for Writer<'_, T, R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Writer").field("cursor", &self.cursor).finish_non_exhaustive()
    }
}

/// A free slot for the next job. Dropping it without a commit has no effect.
#[must_use = "a claim that is not committed queues nothing"]
pub struct Claim<'a, T, R: Wake = NoWake> {
    hold: Hold<T>,
    /// The writer's; open.
    cursor: &'a mut Cursor,
    /// Whom to wake; none in a batch.
    publish: Option<&'a R>,
}

impl<T, R: Wake> Claim<'_, T, R> {
    /// Returns the number that the job must have.
    #[inline(always)]
    pub fn number(&self) -> u16 {
        self.cursor.number()
    }

    /// Queues `job`.
    ///
    /// # Errors
    ///
    /// [`NumberError`] if `number` is not the next one; the job is dropped and nothing has changed.
    #[inline(always)]
    pub fn commit(self, number: u16, job: T) -> Result<(), NumberError> {
        self.commit_with(number, || job)
    }

    /// Queues what `job` returns, and calls it only if the number is the next one. The job is built in its slot, without a
    /// copy if the compiler can inline `job`.
    ///
    /// # Errors
    ///
    /// [`NumberError`] if `number` is not the next one; `job` was not called and nothing has changed.
    #[inline(always)]
    pub fn commit_with(self, number: u16, job: impl FnOnce() -> T) -> Result<(), NumberError> {
        if number != self.number() {
            return Err(refuse(self.cursor.last(self.hold.limits()), self.number(), number));
        }
        self.push_with(job);
        Ok(())
    }

    /// Queues `job` with the next number, and returns that number: for a link whose jobs are not numbered.
    #[inline(always)]
    pub fn push(self, job: T) -> u16 {
        self.push_with(|| job)
    }

    /// Queues a job as [`push`](Self::push) does, built in the slot.
    #[inline(always)]
    pub fn push_with(self, job: impl FnOnce() -> T) -> u16 {
        let number = self.number();
        // SAFETY: the cursor is open, so by 2 and 4 the slot is the writer's and is empty.
        unsafe { self.hold.slot(self.cursor).place().write(job()) };
        if self.cursor.advance(1) {
            turn(self.hold, self.cursor, self.publish.is_some());
        } else if self.publish.is_some() {
            self.hold.set_tail(self.cursor.at);
        }
        if let Some(reader) = self.publish {
            reader.wake();
        }
        number
    }
}

#[cold]
#[inline(never)]
fn refuse(last: Option<u16>, expected: u16, found: u16) -> NumberError {
    if last == Some(found) {
        NumberError::Repeated { number: found }
    } else {
        NumberError::Unexpected { expected, found }
    }
}

impl<T, R: Wake> fmt::Debug for Claim<'_, T, R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Claim").field("number", &self.number()).finish()
    }
}

/// Free slots for the next jobs. Dropping it without [`publish`](Self::publish) has no effect: the jobs in it are dropped.
#[must_use = "a batch that is not published queues nothing"]
pub struct Batch<'a, T, R: Wake = NoWake> {
    hold: Hold<T>,
    /// The writer's, ahead of the tail.
    cursor: &'a mut Cursor,
    /// The position of the tail.
    start: u32,
    /// The end of the claimed slots.
    end: u32,
    /// The number of claimed slots.
    slots: u32,
    reader: &'a R,
}

impl<T, R: Wake> Batch<'_, T, R> {
    /// Claims the next of the slots. A job committed there counts as queued for the numbers of this batch.
    ///
    /// # Errors
    ///
    /// [`Full`] when all are filled.
    #[inline(always)]
    pub fn claim(&mut self) -> Result<Claim<'_, T, R>, Full> {
        if self.cursor.at == self.end {
            return Err(Full);
        }
        Ok(Claim { hold: self.hold, cursor: self.cursor, publish: None })
    }

    /// Fills the slots with `jobs` under the next numbers, as far as both reach.
    #[inline(always)]
    pub fn fill(&mut self, jobs: impl IntoIterator<Item = T>) {
        let (mut jobs, left) = (jobs.into_iter(), self.slots - self.filled());
        if left > self.cursor.stop - self.cursor.at {
            return fill_singly(self.hold, self.cursor, left, jobs);
        }
        let slots = self.hold.row(self.cursor, left);
        let mut filled = PublishOnDrop { cursor: self.cursor, jobs: 0 };
        // By reference: the iterator may panic when it is dropped, which is after the turn.
        for (slot, job) in slots.iter().zip(&mut jobs) {
            // SAFETY: the slots of the row are the writer's without a job.
            unsafe { slot.place().write(job) };
            filled.jobs += 1;
        }
        drop(filled);
        if self.cursor.at == self.cursor.stop {
            turn(self.hold, self.cursor, false);
        }
    }

    /// Returns the number of slots that contain a job.
    #[inline(always)]
    fn filled(&self) -> u32 {
        self.hold.limits().distance(self.start, self.cursor.at)
    }

    /// Queues the jobs that were committed, and returns how many.
    #[inline(always)]
    pub fn publish(self) -> usize {
        let batch = core::mem::ManuallyDrop::new(self);
        let count = batch.filled();
        if count > 0 {
            batch.hold.set_tail(batch.cursor.at);
            batch.reader.wake();
        }
        count as usize
    }
}

/// Fills slots in which a lap ends, or the numbers do.
#[cold]
#[inline(never)]
fn fill_singly<T>(hold: Hold<T>, cursor: &mut Cursor, slots: u32, jobs: impl Iterator<Item = T>) {
    for (_, job) in (0..slots).zip(jobs) {
        Claim { hold, cursor, publish: None::<&NoWake> }.push(job);
    }
}

/// Moves the cursor over the filled slots when it is dropped, even if a job panics.
struct PublishOnDrop<'a> {
    cursor: &'a mut Cursor,
    jobs: u32,
}

impl Drop for PublishOnDrop<'_> {
    #[inline(always)]
    fn drop(&mut self) {
        self.cursor.at += self.jobs;
    }
}

impl<T, R: Wake> Drop for Batch<'_, T, R> {
    #[inline(always)]
    fn drop(&mut self) {
        if self.start != self.cursor.at {
            drop_unpublished(self.hold, self.cursor, self.start);
        }
    }
}

/// Moves back to the beginning of a batch, and drops the jobs that were filled from there on.
#[cold]
#[inline(never)]
fn drop_unpublished<T>(hold: Hold<T>, cursor: &mut Cursor, start: u32) {
    let end = cursor.at;
    *cursor = cursor.back_at(start, hold.limits());
    let mut filled = *cursor;
    filled.end = end;
    while filled.is_open() {
        // SAFETY: the slot is the writer's and was filled.
        let job = unsafe { hold.slot(&filled).place().read() };
        filled.step(hold.limits());
        drop(job); // should it panic, the others are forgotten
    }
}

impl<T, R: Wake> fmt::Debug for Batch<'_, T, R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Batch").field("next", &self.cursor.number()).finish_non_exhaustive()
    }
}
