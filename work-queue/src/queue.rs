use core::fmt;

use crate::error::ConfigError;
use crate::number::check_config;
use crate::position::Position;
use crate::reader::Reader;
use crate::ring::{Ring, Slot};
use crate::sync::Word;
use crate::writer::Writer;

/// A queue of at most `N` jobs, stored inline: `1..=9999`, any number, not only powers of two.
///
/// [`split`](Self::split) it into its two ends. When the queue is dropped, its remaining jobs are dropped too.
pub struct WorkQueue<T, const N: usize> {
    ring: Ring<[Slot<T>; N]>,
    max_number: u16,
}

macro_rules! new {
    ($($constant:tt)?) => {
        /// An empty queue whose jobs are numbered `1..=max_number`, then 1 again.
        ///
        /// Both ends of a link must use the same `max_number`. If possible, it should be at least the number of jobs of an order.
        ///
        /// # Errors
        ///
        /// [`ConfigError`] if `N` is outside `1..=9999`, or if `max_number` is not above it, so that one number could be queued
        /// twice.
        pub $($constant)? fn new(max_number: u16) -> Result<Self, ConfigError> {
            match check_config(N, max_number) {
                Ok(()) => Ok(WorkQueue { ring: Ring::new(), max_number }),
                Err(error) => Err(error),
            }
        }
    };
}

impl<T, const N: usize> WorkQueue<T, N> {
    #[cfg(not(loom))]
    new!(const);
    #[cfg(loom)]
    new!();

    /// The two ends. Each split empties the queue: the remaining jobs are dropped, and the next number is 1.
    pub fn split(&mut self) -> (Writer<'_, T>, Reader<'_, T>) {
        self.split_at(Position::START)
    }

    /// As [`split`](Self::split), beginning at a given lap, for tests in which laps wrap around.
    #[doc(hidden)]
    pub fn split_at_lap(&mut self, lap: Word) -> (Writer<'_, T>, Reader<'_, T>) {
        self.split_at(Position::lap(lap))
    }

    fn split_at(&mut self, start: Position) -> (Writer<'_, T>, Reader<'_, T>) {
        let ring: &mut Ring<[Slot<T>]> = &mut self.ring;
        let (write, read) = ring.restart(start);
        (Writer::new(write, self.max_number), Reader::new(read))
    }
}

impl<T, const N: usize> Drop for WorkQueue<T, N> {
    fn drop(&mut self) {
        let ring: &mut Ring<[Slot<T>]> = &mut self.ring;
        ring.drop_jobs();
    }
}

impl<T, const N: usize> fmt::Debug for WorkQueue<T, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("WorkQueue")
            .field("capacity", &N)
            .field("max_number", &self.max_number)
            .finish_non_exhaustive()
    }
}

/// The two ends of a queue of at most `capacity` jobs on the heap, numbered `1..=max_number`, then 1 again.
///
/// The ends own the queue together and can be moved to different threads. The end that is dropped last drops the remaining
/// jobs. Nothing is allocated later.
///
/// # Errors
///
/// [`ConfigError`] if `capacity` is outside `1..=9999`, or if `max_number` is not above it.
#[cfg(feature = "alloc")]
pub fn boxed<T>(
    capacity: usize,
    max_number: u16,
) -> Result<(Writer<'static, T>, Reader<'static, T>), ConfigError> {
    check_config(capacity, max_number)?;
    let (write, read) = crate::ring::boxed(capacity, Position::START);
    Ok((Writer::new(write, max_number), Reader::new(read)))
}
