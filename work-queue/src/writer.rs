use core::fmt;
use core::marker::PhantomData;

use crate::error::{Full, NumberError};
use crate::number::Numbering;
use crate::ring::{Reserved, WriteEnd};

/// The end of the communication task: queues jobs, in the order of their numbers. There is one for each queue.
///
/// For each job of a packet: [`claim`](Self::claim) a slot, decode the job, [`commit`](Claim::commit) it. When the queue is
/// [`Full`], discard the rest of the packet, wait until it has [`drained`](Self::drained), and ask for a resend from the job
/// after [`last_number`](Self::last_number).
///
/// Nothing here ever waits for the reader.
pub struct Writer<'q, T> {
    end: WriteEnd<T>,
    numbering: Numbering,
    storage: PhantomData<&'q mut ()>,
}

impl<T> Writer<'_, T> {
    pub(crate) fn new(end: WriteEnd<T>, max_number: u16) -> Self {
        Writer { end, numbering: Numbering::new(max_number), storage: PhantomData }
    }

    /// Claims the next slot. A full queue is reported here, before a job is decoded and before its number is checked.
    ///
    /// # Errors
    ///
    /// [`Full`] if every slot holds a job that was not completed yet.
    #[inline(always)]
    pub fn claim(&mut self) -> Result<Claim<'_, T>, Full> {
        match self.end.reserve() {
            Some(slot) => Ok(Claim { slot, numbering: &mut self.numbering }),
            None => Err(Full),
        }
    }

    /// Discards every job that is queued now; the numbering continues.
    ///
    /// The reader discards them when it next takes a job. A job that it is executing is not discarded, and one more may still
    /// start until the writer [`is_settled`](Self::is_settled). Jobs queued from now on are kept.
    pub fn clear(&mut self) {
        self.end.discard();
    }

    /// Discards every job that is queued now, as [`clear`](Self::clear) does, and restarts the numbering: the next job is 1.
    pub fn reset(&mut self) {
        self.clear();
        self.numbering.restart();
    }

    /// Whether the last [`clear`](Self::clear) or [`reset`](Self::reset) has taken effect: no job from before it is
    /// queued or being executed any more. Also true if neither was ever called.
    pub fn is_settled(&self) -> bool {
        self.end.is_settled()
    }

    /// The number that the next job must have: `1..=max_number`.
    pub fn next_number(&self) -> u16 {
        self.numbering.next()
    }

    /// The number of the job queued last; `None` before the first, never 0.
    pub fn last_number(&self) -> Option<u16> {
        self.numbering.last()
    }

    /// The highest job number: 1 follows it.
    pub fn max_number(&self) -> u16 {
        self.numbering.max()
    }

    /// How many jobs the queue holds at most: `1..=9999`.
    pub fn capacity(&self) -> usize {
        self.end.capacity()
    }

    /// How many slots are free. A slot completed out of order counts when all before it are completed too.
    pub fn free(&self) -> usize {
        self.end.free()
    }

    /// Whether no slot is free.
    pub fn is_full(&self) -> bool {
        self.free() == 0
    }

    /// Whether at most `low_water` jobs are left in the queue, the one being executed included.
    ///
    /// Wait for this after [`Full`], not for one free slot: then the missing jobs are sent as a whole batch, and the reader's
    /// progress is read once for all of them.
    pub fn drained(&self, low_water: usize) -> bool {
        self.capacity() - self.free() <= low_water
    }

    /// Whether the reader is gone: jobs queued now are never executed.
    pub fn is_abandoned(&self) -> bool {
        self.end.is_abandoned()
    }
}

impl<T> fmt::Debug for Writer<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Writer").field("end", &self.end).field("numbering", &self.numbering).finish()
    }
}

/// A free slot for the next job. Dropping it without a commit has no effect.
#[must_use = "a claim that is not committed queues nothing"]
pub struct Claim<'a, T> {
    slot: Reserved<'a, T>,
    numbering: &'a mut Numbering,
}

impl<T> Claim<'_, T> {
    /// The number that the job must have.
    pub fn number(&self) -> u16 {
        self.numbering.next()
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

    /// Queues what `job` returns, and calls it only if the number is right. The job is built in its slot: nothing is copied if
    /// the compiler can inline `job`.
    ///
    /// # Errors
    ///
    /// [`NumberError`] if `number` is not the next one; `job` was not called and nothing has changed.
    #[inline(always)]
    pub fn commit_with(self, number: u16, job: impl FnOnce() -> T) -> Result<(), NumberError> {
        self.numbering.check(number)?;
        self.push_with(job);
        Ok(())
    }

    /// Queues `job` with the next number, and returns that number: for a link whose jobs have none.
    #[inline(always)]
    pub fn push(self, job: T) -> u16 {
        self.push_with(|| job)
    }

    /// As [`push`](Self::push), built in the slot.
    #[inline(always)]
    pub fn push_with(self, job: impl FnOnce() -> T) -> u16 {
        let number = self.numbering.next();
        self.slot.fill(number, job);
        self.numbering.advance();
        number
    }
}

impl<T> fmt::Debug for Claim<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Claim").field("number", &self.number()).finish()
    }
}
