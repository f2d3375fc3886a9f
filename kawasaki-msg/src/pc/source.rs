use crate::job::Work;

/// The source of the jobs of an order, by their index in it, and repeatedly, so that the session itself stores no jobs.
///
/// A slice is a source, and so is a closure `FnMut(u32) -> Supply<W>`.
pub trait JobSource {
    /// The type of a job.
    type Work: Work;

    /// Returns the job at an index, counted from 0. The same index always gives the same job, until the order is over.
    fn job(&mut self, index: u32) -> Supply<Self::Work>;
}

/// The result of a [`JobSource`] for an index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Supply<W> {
    /// The job at the index.
    Job(W),
    /// No job yet: jobs that are still being computed (thesis, section 13.1).
    Later,
    /// No job, ever: the index is the number of jobs of the order.
    End,
}

impl<W: Work> JobSource for &[W] {
    type Work = W;

    fn job(&mut self, index: u32) -> Supply<W> {
        let work = usize::try_from(index).ok().and_then(|index| self.get(index));
        work.map_or(Supply::End, |work| Supply::Job(*work))
    }
}

impl<W: Work, F: FnMut(u32) -> Supply<W>> JobSource for F {
    type Work = W;

    fn job(&mut self, index: u32) -> Supply<W> {
        self(index)
    }
}
