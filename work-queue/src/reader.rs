use core::fmt;
use core::marker::PhantomData;
use core::ops::Deref;

use crate::ring::{Held, ReadEnd, Waiting};

/// The end of the motion task: takes jobs, executes them, completes them. There is one for each queue.
///
/// Nothing here ever waits for the writer.
pub struct Reader<'q, T> {
    end: ReadEnd<T>,
    storage: PhantomData<&'q mut ()>,
}

impl<T> Reader<'_, T> {
    pub(crate) fn new(end: ReadEnd<T>) -> Self {
        Reader { end, storage: PhantomData }
    }

    /// Takes the oldest job, by reference; `None` if there is none yet.
    #[inline(always)]
    pub fn take(&mut self) -> Option<Taken<'_, T>> {
        self.end.take().map(|held| Taken { held })
    }

    /// Takes the oldest job for which `predicate` returns true; its arguments are the number and the job. The job overtakes those
    /// before it.
    ///
    /// For applications in which the order of jobs does not matter. The slot of a job completed out of order becomes free when
    /// all before it are completed. In the worst case every waiting job is examined.
    pub fn take_where(&mut self, predicate: impl FnMut(u16, &T) -> bool) -> Option<Taken<'_, T>> {
        self.end.find(predicate).map(|held| Taken { held })
    }

    /// The waiting jobs with their numbers, oldest first.
    pub fn iter(&self) -> Iter<'_, T> {
        Iter { waiting: self.end.waiting() }
    }

    /// How many jobs wait. They are counted one by one.
    pub fn len(&self) -> usize {
        self.iter().count()
    }

    /// Whether no job waits.
    pub fn is_empty(&self) -> bool {
        self.iter().next().is_none()
    }

    /// How many jobs the queue holds at most: `1..=9999`.
    pub fn capacity(&self) -> usize {
        self.end.capacity()
    }

    /// Whether the writer is gone. If [`take`](Self::take) returns `None` *after* this was true, it always will.
    pub fn is_abandoned(&self) -> bool {
        self.end.is_abandoned()
    }
}

impl<T> fmt::Debug for Reader<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Reader").field("end", &self.end).finish()
    }
}

impl<'a, T> IntoIterator for &'a Reader<'_, T> {
    type Item = (u16, &'a T);
    type IntoIter = Iter<'a, T>;

    fn into_iter(self) -> Iter<'a, T> {
        self.iter()
    }
}

/// A job that is being executed, in its slot. A reset does not discard it.
///
/// Only [`complete`](Self::complete) frees the slot. If this is dropped without it, the job waits again; if it was the oldest,
/// [`Reader::take`] returns it next, unless a reset has discarded it meanwhile.
#[must_use = "a job that is not completed waits again"]
pub struct Taken<'a, T> {
    held: Held<'a, T>,
}

impl<T> Taken<'_, T> {
    /// The number of the job: `1..=max_number`.
    #[inline]
    pub fn number(&self) -> u16 {
        self.held.number()
    }

    /// Frees the slot of the executed job and returns the job.
    #[inline(always)]
    pub fn complete(self) -> T {
        self.held.complete()
    }
}

impl<T> Deref for Taken<'_, T> {
    type Target = T;

    #[inline(always)]
    fn deref(&self) -> &T {
        self.held.job()
    }
}

impl<T: fmt::Debug> fmt::Debug for Taken<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Taken").field("number", &self.number()).field("job", &**self).finish()
    }
}

/// The waiting jobs of a [`Reader`] with their numbers, oldest first.
pub struct Iter<'a, T> {
    waiting: Waiting<'a, T>,
}

impl<'a, T> Iterator for Iter<'a, T> {
    type Item = (u16, &'a T);

    fn next(&mut self) -> Option<Self::Item> {
        self.waiting.next().map(|(_, number, job)| (number, job))
    }
}

impl<T> fmt::Debug for Iter<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Iter").finish_non_exhaustive()
    }
}
