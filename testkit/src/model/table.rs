//! The tables of all machines, as one type.

use super::matrix::{Cell, Rows, cells, check_times};

/// The table of a machine.
#[derive(Debug, Clone, Copy)]
pub struct Table {
    /// The crate.
    pub link: &'static str,
    /// Every cell.
    pub cells: fn() -> Vec<Cell>,
    /// Checks the machine's times and its size.
    pub check: fn(&Self),
    /// The largest allowed size of the machine, in bytes.
    size: usize,
}

impl Table {
    /// Returns the table of these rows, whose machine has at most this many bytes.
    pub const fn of<R: Rows>(link: &'static str, size: usize) -> Self {
        Self { link, cells: cells::<R>, check: check::<R>, size }
    }
}

fn check<R: Rows>(table: &Table) {
    check_times::<R>();
    let size = size_of::<R::Machine>();
    assert!(size <= table.size, "{}: {size} bytes, not {}", table.link, table.size);
}
