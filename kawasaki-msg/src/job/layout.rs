//! The fields of a job without a job: what they are called, what they hold, how long they can get.

use core::ops::RangeInclusive;

use super::Text;
use super::work::{Fields, Unfit, Work};
use crate::error::{ConfigError, FieldError, Name};
use crate::number::{self, Decimal};

/// How many bytes the own fields of a message may have that is read, with the mark before each and two after them.
pub(crate) const LONGEST: usize = 1024;

/// What one field of a job is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FieldLayout<'a> {
    /// What it is called; not on the wire.
    pub name: &'a str,
    /// What it holds.
    pub holds: FieldType,
}

/// What a field of a job holds. The ranges include both ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FieldType {
    /// A number.
    #[allow(missing_docs, reason = "the names say it")]
    Number { min: Decimal, max: Decimal },
    /// Text of this many characters.
    #[allow(missing_docs, reason = "the names say it")]
    Text { min: usize, max: usize },
}

impl FieldType {
    /// No value is in its range.
    fn is_empty(&self) -> bool {
        match self {
            FieldType::Number { min, max } => min.units > max.units || min.places > Decimal::MAX_PLACES,
            FieldType::Text { min, max } => min > max,
        }
    }

    /// The most bytes on the wire.
    fn longest(&self) -> usize {
        match *self {
            FieldType::Number { min, max } => {
                let length = |decimal: Decimal| number::len(decimal.units, decimal.places);
                length(min).max(length(max))
            }
            FieldType::Text { max, .. } => max,
        }
    }
}

/// Shows the fields of a job in the order of the wire, as they are for `W::default()`.
pub fn each_field<W: Work>(ranges: &W::Ranges, show: impl FnMut(FieldLayout<'_>)) {
    // It refuses nothing.
    let _ = W::default().fields(ranges, &mut Lister(show));
}

/// Whether each field of a job can have a value; the most bytes of all of them, with a separator for each.
pub(crate) fn check<W: Work>(ranges: &W::Ranges) -> Result<usize, ConfigError> {
    let mut empty = Ok(());
    each_field::<W>(ranges, |field| {
        if field.holds.is_empty() && empty.is_ok() {
            empty = Err(ConfigError::EmptyRange { field: Name::of(field.name) });
        }
    });
    empty?;
    // Blanks and zeros may be around them.
    let (found, limit) = (longest::<W>(ranges), LONGEST - 64);
    if found > limit { Err(ConfigError::JobTooLong { found, limit }) } else { Ok(found) }
}

fn longest<W: Work>(ranges: &W::Ranges) -> usize {
    let mut bytes = 0;
    each_field::<W>(ranges, |field| bytes += field.holds.longest() + 1);
    bytes
}

/// How many fields a job has.
pub(super) fn count<W: Work>(ranges: &W::Ranges) -> usize {
    let mut count = 0;
    each_field::<W>(ranges, |_| count += 1);
    count
}

struct Lister<S>(S);

impl<S: FnMut(FieldLayout<'_>)> Fields for Lister<S> {
    fn decimal(
        &mut self,
        name: &str,
        _: &mut i32,
        places: u8,
        range: RangeInclusive<i32>,
    ) -> Result<(), Unfit> {
        let [min, max] = [*range.start(), *range.end()].map(|units| Decimal { units, places });
        (self.0)(FieldLayout { name, holds: FieldType::Number { min, max } });
        Ok(())
    }

    fn text<const N: usize>(
        &mut self,
        name: &str,
        _: &mut Text<N>,
        length: RangeInclusive<usize>,
    ) -> Result<(), Unfit> {
        let holds = FieldType::Text { min: *length.start(), max: N.min(*length.end()) };
        (self.0)(FieldLayout { name, holds });
        Ok(())
    }

    fn refuse(&mut self, _: FieldError) -> Unfit {
        Unfit(())
    }

    /// The default of an enum or a number is no code to check.
    fn whole<T: Copy + Into<i32> + TryFrom<i32>>(
        &mut self,
        name: &str,
        _: &mut T,
        range: RangeInclusive<T>,
    ) -> Result<(), Unfit> {
        let (min, max) = range.into_inner();
        self.decimal(name, &mut 0, 0, min.into()..=max.into())
    }
}
