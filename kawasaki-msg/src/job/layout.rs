//! The fields of a job without a job: whether they can have values, and their maximum length.

use core::ops::RangeInclusive;

use super::work::{FieldVisitor, Unfit, VisitResult, Work};
use crate::error::{ConfigError, FieldError};
use crate::number::{self, Decimal};
use crate::text::{Name, Text};

/// The maximum number of bytes of a job's own fields when read, with the mark before each field and two marks after them.
pub(crate) const MAX_FIELDS_LEN: usize = 1024;

/// Checks that each field of a job can have a value; returns the maximum number of bytes of all fields, with a separator for
/// each.
pub(crate) fn check<W: Work>(ranges: &W::Ranges) -> Result<usize, ConfigError> {
    let Layout { longest: found, empty, .. } = Layout::of::<W>(ranges);
    // Blanks and zeros may surround them.
    let limit = MAX_FIELDS_LEN - 64;
    match empty {
        Some(field) => Err(ConfigError::EmptyRange { field }),
        None if found > limit => Err(ConfigError::JobTooLong { found, limit }),
        None => Ok(found),
    }
}

/// Returns the number of fields of a job.
pub(super) fn count<W: Work>(ranges: &W::Ranges) -> usize {
    Layout::of::<W>(ranges).count
}

/// The fields of a job, as they are for `W::default()`.
#[derive(Default)]
struct Layout {
    count: usize,
    /// The most bytes of all fields, with a separator for each.
    longest: usize,
    /// The first field without a value in its range.
    empty: Option<Name>,
}

impl Layout {
    fn of<W: Work>(ranges: &W::Ranges) -> Self {
        let mut layout = Self::default();
        // The layout refuses nothing.
        let _ = W::default().fields(ranges, &mut layout);
        layout
    }

    fn add(&mut self, name: &str, is_empty: bool, longest: usize) -> VisitResult {
        self.count += 1;
        self.longest += longest + 1;
        if is_empty && self.empty.is_none() {
            self.empty = Some(Name::of(name));
        }
        Ok(())
    }
}

impl FieldVisitor for Layout {
    fn decimal(&mut self, name: &str, _: &mut i32, places: u8, range: RangeInclusive<i32>) -> VisitResult {
        let (min, max) = range.into_inner();
        let longest = number::len(min, places).max(number::len(max, places));
        self.add(name, min > max || places > Decimal::MAX_PLACES, longest)
    }

    fn text<const N: usize>(
        &mut self,
        name: &str,
        _: &mut Text<N>,
        length: RangeInclusive<usize>,
    ) -> VisitResult {
        let (min, max) = (*length.start(), N.min(*length.end()));
        self.add(name, min > max, max)
    }

    fn refuse(&mut self, _: FieldError) -> Unfit {
        Unfit(())
    }

    /// Checks the range alone: the default of an enum or a number is not a code to check.
    fn whole<T: Copy + Into<i32> + TryFrom<i32>>(
        &mut self,
        name: &str,
        _: &mut T,
        range: RangeInclusive<T>,
    ) -> VisitResult {
        let (min, max) = range.into_inner();
        self.decimal(name, &mut 0, 0, min.into()..=max.into())
    }
}
