//! Jobs: the user's own type, its fields, and their reader and writer.

mod drawing;
mod layout;
mod reader;
mod work;
mod writer;

pub use drawing::{Bounds, JobKind, Line, Point};
pub(crate) use layout::{MAX_FIELDS_LEN, check};
pub(crate) use reader::{ReadError, read};
pub use work::{FieldVisitor, Unfit, VisitResult, Work};
pub(crate) use writer::write;

/// One job of an order, as a queue stores it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Job<W> {
    /// The number of the job's order, from 1.
    pub order: u16,
    /// The job's number in the order: from 1 to the highest that both ends agreed on (9999 at most), then 1 again.
    pub number: u16,
    /// The job's own fields: the motion of the plant.
    pub work: W,
}
