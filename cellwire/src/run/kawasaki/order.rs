//! The jobs of an order, as the session requests them.

use kawasaki_msg::{JobSource, Supply};

use cellwire_links::kawasaki_msg::layout::AnyWork;

/// The jobs of an order.
#[derive(Debug)]
pub(super) struct Order<'a> {
    /// The jobs of the file.
    pub jobs: &'a [AnyWork],
    /// The places of the order's jobs in `jobs`.
    pub places: Vec<usize>,
}

impl JobSource for Order<'_> {
    type Work = AnyWork;

    fn job(&mut self, index: u32) -> Supply<AnyWork> {
        let place = usize::try_from(index).ok().and_then(|index| self.places.get(index));
        place.and_then(|place| self.jobs.get(*place)).map_or(Supply::End, |work| Supply::Job(*work))
    }
}
