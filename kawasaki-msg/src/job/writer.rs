//! The one writer of a job's message.

use core::ops::RangeInclusive;

use super::work::{Decimal, Fields, Unfit, Work};
use super::{Job, Text};
use crate::dialect::Dialect;
use crate::error::{EncodeError, FieldError, FieldFault, Name};
use crate::message::Message;
use crate::number::{self, Digits};
use crate::role::{Field, Role};
use crate::value::{Charset, DATA, END, SEPARATOR, START, is_mark};

/// Writes the message of a job and gives its length.
pub(crate) fn encode<W: Work>(
    dialect: &Dialect<'_>,
    job: &Job<W>,
    ranges: &W::Ranges,
    out: &mut [u8],
) -> Result<usize, EncodeError> {
    let entry = dialect.entry(Role::Job).ok_or(EncodeError::NoName)?;
    let available = out.len();
    let mut writer = Writer { out, length: 0, charset: dialect.charset(), error: None };
    writer.push(START);
    writer.characters(entry.name)?;
    for field in entry.header {
        writer.push(SEPARATOR);
        writer.field(field, job, ranges)?;
    }
    writer.push(SEPARATOR);
    let length_at = writer.length;
    // The length of most jobs has two digits.
    writer.put(&[b'0', b'0', DATA]);
    let data_at = writer.length;
    for (place, field) in entry.fields.iter().enumerate() {
        if place > 0 {
            writer.push(SEPARATOR);
        }
        writer.field(field, job, ranges)?;
    }
    let data = writer.length - data_at;
    writer.put(&[DATA, END]);
    let digits = Digits::new(i32::try_from(data).unwrap_or(i32::MAX));
    let digits = digits.as_bytes();
    let needed = writer.length + digits.len() - 2;
    if needed > Message::MAX_LEN {
        return Err(EncodeError::TooLong { length: needed, limit: Message::MAX_LEN });
    }
    // One of a single digit is written with two first.
    if needed.max(writer.length) > available {
        return Err(EncodeError::BufferTooSmall { needed: needed.max(writer.length), available });
    }
    writer.out.copy_within(length_at + 2..writer.length, length_at + digits.len());
    if let Some(place) = writer.out.get_mut(length_at..length_at + digits.len()) {
        place.copy_from_slice(digits);
    }
    Ok(needed)
}

/// Counts what it has no room for.
struct Writer<'o> {
    out: &'o mut [u8],
    length: usize,
    charset: Charset,
    error: Option<FieldError>,
}

impl Writer<'_> {
    fn field<W: Work>(
        &mut self,
        field: &Field<'_>,
        job: &Job<W>,
        ranges: &W::Ranges,
    ) -> Result<(), EncodeError> {
        match field {
            Field::Order => self.put(Digits::new(i32::from(job.order)).as_bytes()),
            Field::Number => self.put(Digits::new(i32::from(job.number)).as_bytes()),
            Field::Constant(text) => self.characters(text)?,
            Field::Work => {
                let mut work = job.work;
                if let Err(Unfit(())) = work.fields(ranges, &mut Separated { writer: self, is_first: true }) {
                    let unnamed = FieldError { field: Name::of(""), fault: FieldFault::Missing };
                    return Err(EncodeError::Field(self.error.unwrap_or(unnamed)));
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn characters(&mut self, text: &str) -> Result<(), EncodeError> {
        text.chars().try_for_each(|c| {
            self.push(self.charset.byte(c)?);
            Ok(())
        })
    }

    fn push(&mut self, byte: u8) {
        self.put(&[byte]);
    }

    #[inline]
    fn put(&mut self, bytes: &[u8]) {
        if let Some(place) = self.out.get_mut(self.length..self.length + bytes.len()) {
            place.copy_from_slice(bytes);
        }
        self.length += bytes.len();
    }
}

/// A separator before each field but the first.
struct Separated<'w, 'o> {
    writer: &'w mut Writer<'o>,
    is_first: bool,
}

impl Separated<'_, '_> {
    fn separate(&mut self) {
        if !core::mem::take(&mut self.is_first) {
            self.writer.push(SEPARATOR);
        }
    }

    fn fail(&mut self, name: &str, fault: FieldFault) -> Result<(), Unfit> {
        Err(self.refuse(FieldError { field: Name::of(name), fault }))
    }
}

impl Fields for Separated<'_, '_> {
    fn decimal(
        &mut self,
        name: &str,
        value: &mut i32,
        places: u8,
        range: RangeInclusive<i32>,
    ) -> Result<(), Unfit> {
        if !range.contains(value) {
            let [found, min, max] =
                [*value, *range.start(), *range.end()].map(|units| Decimal { units, places });
            return self.fail(name, FieldFault::OutOfRange { found, min, max });
        }
        self.separate();
        if places == 0 {
            self.writer.put(Digits::new(*value).as_bytes());
        } else {
            digits(*value, places).for_each(|byte| self.writer.push(byte));
        }
        Ok(())
    }

    fn text<const N: usize>(
        &mut self,
        name: &str,
        value: &mut Text<N>,
        length: RangeInclusive<usize>,
    ) -> Result<(), Unfit> {
        let (bytes, charset) = (value.as_bytes(), self.writer.charset);
        if !length.contains(&bytes.len()) {
            let (min, max) = (*length.start(), N.min(*length.end()));
            return self.fail(name, FieldFault::Length { found: bytes.len(), min, max });
        }
        match bytes.iter().copied().find(|byte| is_mark(*byte) || !charset.has(*byte)) {
            Some(found) if is_mark(found) => return self.fail(name, FieldFault::Reserved { found }),
            Some(found) => return self.fail(name, FieldFault::Character { found: char::from(found) }),
            None => {}
        }
        self.separate();
        self.writer.put(bytes);
        Ok(())
    }

    #[cold]
    fn refuse(&mut self, error: FieldError) -> Unfit {
        self.writer.error = Some(error);
        Unfit(())
    }
}

/// The digits of a number with a point before the last `places`.
pub(super) fn digits(units: i32, places: u8) -> impl Iterator<Item = u8> {
    let places = usize::from(places);
    let (sign, length) = (units < 0, number::len(units) - usize::from(units < 0));
    let zeros = (places + 1).saturating_sub(length);
    let whole = length + zeros - places;
    let digits = Digits::new(units).skip(usize::from(sign));
    let digits = core::iter::repeat_n(b'0', zeros).chain(digits).enumerate();
    let with_point = digits.flat_map(move |(at, digit)| {
        let point = (at == whole && places > 0).then_some(b'.');
        point.into_iter().chain(Some(digit))
    });
    sign.then_some(b'-').into_iter().chain(with_point)
}
