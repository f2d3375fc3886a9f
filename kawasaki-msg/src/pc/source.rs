use crate::job::Work;

/// Where a PC session gets the jobs of an order: by their place in it, also again, so that the session itself holds none.
///
/// A slice is one, and so is a closure `FnMut(u32) -> Supply<W>`.
pub trait JobSource {
    /// What a job is.
    type Work: Work;

    /// The job of a place, counted from 0. The same place always gives the same job, until the order is over.
    fn job(&mut self, index: u32) -> Supply<Self::Work>;
}

/// What a [`JobSource`] has at a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Supply<W> {
    /// This job.
    Job(W),
    /// Nothing yet: jobs that are still being worked out (thesis, section 13.1).
    Later,
    /// Nothing, ever: the order has as many jobs as the place says.
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
