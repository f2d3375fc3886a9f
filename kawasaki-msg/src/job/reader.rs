//! The reader of a job's own fields.

use core::ops::RangeInclusive;

use super::work::{Decimal, Fields, Unfit, Work};
use super::{Text, layout};
use crate::error::{FieldError, FieldFault, MessageError, Name};
use crate::number::Fault;
use crate::value::{Charset, Left, START, Values, is_mark};

/// The job in these values, which are all of its fields and nothing else.
///
/// # Errors
/// The first field that does not fit, or that there are more values than fields.
pub(crate) fn read<W: Work>(
    values: Values<'_>,
    ranges: &W::Ranges,
    charset: Charset,
) -> Result<W, MessageError> {
    let mut reader = Reader { values: Left(values), charset, error: None };
    let mut work = W::default();
    match (work.fields(ranges, &mut reader), reader.error) {
        (Err(Unfit(())), Some(error)) => Err(MessageError::Field(error)),
        (Ok(()), _) if reader.values.next().is_none() => Ok(work),
        _ => Err(MessageError::FieldCount { expected: layout::count::<W>(ranges), found: 0 }),
    }
}

/// Reads one field after the other, and keeps why one does not fit.
struct Reader<'v> {
    values: Left<'v>,
    charset: Charset,
    error: Option<FieldError>,
}

impl Fields for Reader<'_> {
    #[inline(always)] // places and range are known where a job names them
    fn decimal(
        &mut self,
        name: &str,
        value: &mut i32,
        places: u8,
        range: RangeInclusive<i32>,
    ) -> Result<(), Unfit> {
        let (min, max) = range.into_inner();
        let decimal = |units| Decimal { units, places };
        let Some(number) = self.values.decimal(places) else {
            return Err(self.unfit(name, FieldFault::Missing));
        };
        let fault = match number {
            Ok(units) if min <= units && units <= max => {
                *value = units;
                return Ok(());
            }
            Ok(units) => {
                FieldFault::OutOfRange { found: decimal(units), min: decimal(min), max: decimal(max) }
            }
            Err(Fault::NotANumber) => FieldFault::NotANumber { min: decimal(min), max: decimal(max) },
            Err(Fault::TooPrecise) => FieldFault::TooPrecise { places },
        };
        Err(self.unfit(name, fault))
    }

    fn text<const N: usize>(
        &mut self,
        name: &str,
        value: &mut Text<N>,
        length: RangeInclusive<usize>,
    ) -> Result<(), Unfit> {
        let (min, max) = (*length.start(), N.min(*length.end()));
        let Some(field) = self.values.next() else { return Err(self.unfit(name, FieldFault::Missing)) };
        let (mut text, mut found, mut fits) = (Text::EMPTY, 0, true);
        for c in field.chars() {
            let byte = u8::try_from(c).unwrap_or(START);
            if is_mark(byte) {
                return Err(self.unfit(name, FieldFault::Reserved { found: byte }));
            }
            if !self.charset.has(byte) {
                return Err(self.unfit(name, FieldFault::Character { found: c }));
            }
            fits &= text.push(byte).is_some();
            found += 1;
        }
        if !fits || !(min..=max).contains(&found) {
            return Err(self.unfit(name, FieldFault::Length { found, min, max }));
        }
        *value = text;
        Ok(())
    }

    fn refuse(&mut self, error: FieldError) -> Unfit {
        self.error = Some(error);
        Unfit(())
    }
}

impl Reader<'_> {
    #[cold]
    fn unfit(&mut self, name: &str, fault: FieldFault) -> Unfit {
        self.error = Some(FieldError { field: Name::of(name), fault });
        Unfit(())
    }
}
