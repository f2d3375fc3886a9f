//! The writer of a job's own fields.

use core::ops::RangeInclusive;

use super::work::{FieldVisitor, Unfit, VisitResult, Work};
use crate::error::{EncodeError, FieldError, FieldFault};
use crate::number::Decimal;
use crate::text::{Name, Text};
use crate::writer::Writer;

/// Writes the fields; a job without any has an empty one.
#[inline(always)]
pub(crate) fn write<W: Work>(mut work: W, ranges: &W::Ranges, writer: &mut Writer<'_>) {
    let mut fields = FieldWriter { writer: &mut *writer, is_empty: true, error: None };
    let visited = work.fields(ranges, &mut fields);
    let (is_empty, error) = (fields.is_empty, fields.error);
    if let Err(Unfit(())) = visited {
        let unnamed = FieldError { field: Name::of(""), fault: FieldFault::Missing };
        writer.refuse(EncodeError::Field(error.unwrap_or(unnamed)));
    } else if is_empty {
        writer.empty();
    }
}

struct FieldWriter<'w, 'o> {
    writer: &'w mut Writer<'o>,
    is_empty: bool,
    error: Option<FieldError>,
}

impl FieldVisitor for FieldWriter<'_, '_> {
    #[inline(always)] // places and range are known where a job names them
    fn decimal(
        &mut self,
        name: &str,
        value: &mut i32,
        places: u8,
        range: RangeInclusive<i32>,
    ) -> VisitResult {
        let (min, max) = range.into_inner();
        if *value < min || max < *value {
            return Err(self.out_of_range(name, [*value, min, max].map(|units| Decimal { units, places })));
        }
        self.is_empty = false;
        self.writer.number(*value, places);
        Ok(())
    }

    fn text<const N: usize>(
        &mut self,
        name: &str,
        text: &mut Text<N>,
        length: RangeInclusive<usize>,
    ) -> VisitResult {
        let (min, max) = (*length.start(), N.min(*length.end()));
        let found = text.as_bytes().len();
        if !(min..=max).contains(&found) {
            return Err(self.unfit(name, FieldFault::Length { found, min, max }));
        }
        // No text holds a mark.
        let charset = self.writer.charset();
        if let Some(found) = text.chars().find(|c| charset.byte(*c).is_err()) {
            return Err(self.unfit(name, FieldFault::Character { found }));
        }
        self.is_empty = false;
        self.writer.wire(text.as_bytes());
        Ok(())
    }

    fn refuse(&mut self, error: FieldError) -> Unfit {
        self.error = Some(error);
        Unfit(())
    }
}

impl FieldWriter<'_, '_> {
    #[cold]
    fn out_of_range(&mut self, name: &str, [found, min, max]: [Decimal; 3]) -> Unfit {
        self.unfit(name, FieldFault::OutOfRange { found, min, max })
    }

    #[cold]
    fn unfit(&mut self, name: &str, fault: FieldFault) -> Unfit {
        self.refuse(FieldError { field: Name::of(name), fault })
    }
}
