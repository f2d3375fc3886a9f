use crate::job::Line;

/// Where a PC session gets the jobs of an order: by their place in it, also again, so that the session itself holds none.
///
/// A slice of lines is one, and so is a closure `FnMut(u32) -> Supply`.
pub trait JobSource {
    /// The line of a place, counted from 0. The same place always gives the same line, until the order is over.
    fn line(&mut self, index: u32) -> Supply;
}

/// What a [`JobSource`] has at a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Supply {
    /// This line.
    Line(Line),
    /// Nothing yet: jobs that are still being worked out (thesis, section 13.1).
    Later,
    /// Nothing, ever: the order has as many jobs as the place says.
    End,
}

impl JobSource for &[Line] {
    fn line(&mut self, index: u32) -> Supply {
        let line = usize::try_from(index).ok().and_then(|index| self.get(index));
        line.map_or(Supply::End, |line| Supply::Line(*line))
    }
}

impl<F: FnMut(u32) -> Supply> JobSource for F {
    fn line(&mut self, index: u32) -> Supply {
        self(index)
    }
}
