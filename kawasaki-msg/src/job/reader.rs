//! The reader of a job's own fields.

use core::ops::RangeInclusive;

use super::layout;
use super::work::{FieldVisitor, Unfit, VisitResult, Work};
use crate::error::{FieldError, FieldFault};
use crate::number::{Decimal, Fault};
use crate::text::{Name, Text};
use crate::value::Values;

/// The reason that values are not a job.
pub(crate) enum ReadError {
    /// The first field that does not fit.
    Field(FieldError),
    /// There are more values than this many fields.
    Count(usize),
}

/// Reads a job from values that are exactly its fields.
#[inline(always)]
pub(crate) fn read<W: Work>(values: Values<'_>, ranges: &W::Ranges, work: &mut W) -> Result<(), ReadError> {
    let mut reader = Reader { values, error: None };
    *work = W::default();
    match (work.fields(ranges, &mut reader), reader.error) {
        (Err(Unfit(())), Some(error)) => Err(ReadError::Field(error)),
        (Ok(()), _) if reader.values.is_empty() => Ok(()),
        _ => Err(ReadError::Count(layout::count::<W>(ranges))),
    }
}

/// Reads one field after the other, and stores the fault of one that does not fit.
struct Reader<'v> {
    values: Values<'v>,
    error: Option<FieldError>,
}

impl FieldVisitor for Reader<'_> {
    #[inline(always)] // places and range are known where a job names them
    fn decimal(
        &mut self,
        name: &str,
        value: &mut i32,
        places: u8,
        range: RangeInclusive<i32>,
    ) -> VisitResult {
        let (min, max) = range.into_inner();
        match self.values.number(places) {
            Ok(units) if min <= units && units <= max => {
                *value = units;
                Ok(())
            }
            number => Err(self.wrong_number(name, number, places, min, max)),
        }
    }

    fn text<const N: usize>(
        &mut self,
        name: &str,
        text: &mut Text<N>,
        length: RangeInclusive<usize>,
    ) -> VisitResult {
        let (min, max) = (*length.start(), N.min(*length.end()));
        let Some(field) = self.values.text() else { return Err(self.misfit(name, FieldFault::Missing)) };
        let found = field.as_bytes().len();
        match Text::from_wire(field.as_bytes()).filter(|_| min <= found && found <= max) {
            Some(read) => *text = read,
            None => return Err(self.misfit(name, FieldFault::Length { found, min, max })),
        }
        Ok(())
    }

    fn refuse(&mut self, error: FieldError) -> Unfit {
        self.error = Some(error);
        Unfit(())
    }
}

impl Reader<'_> {
    #[cold]
    #[inline(never)]
    fn wrong_number(
        &mut self,
        name: &str,
        number: Result<i32, Fault>,
        places: u8,
        min: i32,
        max: i32,
    ) -> Unfit {
        let [min, max] = [min, max].map(|units| Decimal { units, places });
        let fault = match number {
            Ok(units) => FieldFault::OutOfRange { found: Decimal { units, places }, min, max },
            Err(Fault::Missing) => FieldFault::Missing,
            Err(Fault::NotANumber) => FieldFault::NotANumber { min, max },
            Err(Fault::TooPrecise) => FieldFault::TooPrecise { places },
        };
        self.misfit(name, fault)
    }

    #[cold]
    fn misfit(&mut self, name: &str, fault: FieldFault) -> Unfit {
        self.refuse(FieldError { field: Name::of(name), fault })
    }
}
