//! The one writer of a job's message.

use core::ops::RangeInclusive;

use super::work::{Decimal, Fields, Unfit, Work};
use super::{Job, Text};
use crate::dialect::Dialect;
use crate::error::{EncodeError, FieldError, FieldFault, Name};
use crate::message::Message;
use crate::number::{Digits, eight_digits};
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
    writer.word(u64::from_le_bytes([b'0', b'0', DATA, 0, 0, 0, 0, 0]), 3);
    let data_at = writer.length;
    for (place, field) in entry.fields.iter().enumerate() {
        if place > 0 {
            writer.push(SEPARATOR);
        }
        writer.field(field, job, ranges)?;
    }
    let data = writer.length - data_at;
    writer.word(u64::from_le_bytes([DATA, END, 0, 0, 0, 0, 0, 0]), 2);
    // A job that is longer than a packet has a length of four digits.
    let (digits, count) = text_of(u32::try_from(data).unwrap_or(u32::MAX)).unwrap_or((0, 8));
    let needed = writer.length + count - 2;
    if needed > Message::MAX_LEN {
        return Err(EncodeError::TooLong { length: needed, limit: Message::MAX_LEN });
    }
    // One of a single digit is written with two first.
    if needed.max(writer.length) > available {
        return Err(EncodeError::BufferTooSmall { needed: needed.max(writer.length), available });
    }
    if count != 2 {
        writer.out.copy_within(length_at + 2..writer.length, length_at + count);
    }
    let places = writer.out.get_mut(length_at..length_at + count).unwrap_or_default();
    places.iter_mut().zip(digits.to_le_bytes()).for_each(|(place, digit)| *place = digit);
    Ok(needed)
}

/// A number below 100 000 000 as it is written, the first digit lowest, and how many they are.
#[inline(always)]
fn text_of(number: u32) -> Option<(u64, usize)> {
    let digits = eight_digits(number)?;
    // The last digit is there in any case.
    let zeros = (digits | 1 << 56).trailing_zeros() / 8;
    Some(((digits | ZEROS) >> (8 * zeros), 8 - zeros as usize))
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
            Field::Order => self.number(u32::from(job.order)),
            Field::Number => self.number(u32::from(job.number)),
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

    #[inline]
    fn characters(&mut self, text: &str) -> Result<(), EncodeError> {
        text.chars().try_for_each(|c| {
            self.push(self.charset.byte(c)?);
            Ok(())
        })
    }

    #[inline(always)]
    fn push(&mut self, byte: u8) {
        if let Some(place) = self.out.get_mut(self.length) {
            *place = byte;
        }
        self.length += 1;
    }

    #[inline]
    fn put(&mut self, bytes: &[u8]) {
        if let Some(place) = self.out.get_mut(self.length..self.length + bytes.len()) {
            place.copy_from_slice(bytes);
        }
        self.length += bytes.len();
    }

    /// So many of eight bytes, the lowest first. What is after them is written next.
    #[inline(always)]
    fn word(&mut self, word: u64, length: usize) {
        match self.out.get_mut(self.length..).and_then(<[u8]>::first_chunk_mut) {
            Some(place) => *place = word.to_le_bytes(),
            None => self.short_word(word, length),
        }
        self.length += length;
    }

    #[cold]
    fn short_word(&mut self, word: u64, length: usize) {
        let places = self.out.get_mut(self.length..).unwrap_or_default();
        places.iter_mut().zip(word.to_le_bytes()).take(length).for_each(|(place, byte)| *place = byte);
    }

    /// A number without decimals.
    #[inline(always)]
    fn number(&mut self, number: u32) {
        match text_of(number) {
            Some((text, length)) => self.word(text, length),
            None => digits(number, 0).for_each(|byte| self.push(byte)),
        }
    }

    /// A number with one decimal or more.
    #[inline(always)]
    fn decimal(&mut self, number: u32, places: u8) {
        match eight_digits(number) {
            Some(digits) if places < 8 => {
                let whole = 8 * (8 - u32::from(places));
                // One digit is before the point in any case.
                let zeros = (digits | 1 << (whole - 8)).trailing_zeros() & 0x38;
                let text = digits | ZEROS;
                let before = (text & !(u64::MAX << whole)) >> zeros;
                let point = whole - zeros;
                self.word(before | u64::from(b'.') << point, point as usize / 8 + 1);
                self.word(text >> whole, usize::from(places));
            }
            _ => digits(number, places).for_each(|byte| self.push(byte)),
        }
    }
}

/// A zero in each of eight bytes.
const ZEROS: u64 = u64::from_le_bytes([b'0'; 8]);

/// A separator before each field but the first.
struct Separated<'w, 'o> {
    writer: &'w mut Writer<'o>,
    is_first: bool,
}

impl Separated<'_, '_> {
    #[inline(always)]
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
    #[inline]
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
        if *value < 0 {
            self.writer.push(b'-');
        }
        match places {
            0 => self.writer.number(value.unsigned_abs()),
            _ => self.writer.decimal(value.unsigned_abs(), places),
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
pub(super) fn digits(units: u32, places: u8) -> impl Iterator<Item = u8> {
    let places = usize::from(places);
    let digits = Digits::unsigned(units);
    let zeros = (places + 1).saturating_sub(digits.count());
    let whole = digits.count() + zeros - places;
    let digits = core::iter::repeat_n(b'0', zeros).chain(digits).enumerate();
    digits.flat_map(move |(at, digit)| {
        let point = (at == whole && places > 0).then_some(b'.');
        point.into_iter().chain(Some(digit))
    })
}
