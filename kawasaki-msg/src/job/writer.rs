//! The one writer of a job's message.
//!
//! A field is written eight bytes at once; byte by byte only at the end of a buffer, and where a number has more than eight digits.

use core::iter::once;
use core::mem::take;
use core::ops::RangeInclusive;

use super::work::{Decimal, Fields, Unfit, Work};
use super::{Head, Job, Text};
use crate::dialect::Dialect;
use crate::error::{EncodeError, FieldError, FieldFault, Name};
use crate::message::Message;
use crate::number::{Digits, text_of};
use crate::role::{Field, Role};
use crate::value::{Charset, DATA, END, SEPARATOR, START};

/// Writes the message of a job and gives its length.
pub(crate) fn encode<W: Work>(
    dialect: &Dialect<'_>,
    job: &Job<W>,
    ranges: &W::Ranges,
    out: &mut [u8],
) -> Result<usize, EncodeError> {
    let (available, of) = (out.len(), (job.order, job.number));
    let mut writer = Writer { rest: &mut *out, missing: 0 };
    let (length_at, after);
    if let Some(head) = dialect.head() {
        writer.head(head);
        writer.number(false, u32::from(job.order));
        writer.number(false, u32::from(job.number));
        (length_at, after) = (head.len() - 2, &[][..]);
    } else {
        (writer, length_at, after) = writer.begin(dialect, available, of)?;
    }
    let (mut work, mut error) = (job.work, None);
    let mut written = Written { writer, charset: dialect.charset(), is_empty: true, error: &mut error };
    let visited = work.fields(ranges, &mut written);
    let is_empty = written.is_empty;
    writer = written.writer;
    if let Err(Unfit(())) = visited {
        let unnamed = FieldError { field: Name::of(""), fault: FieldFault::Missing };
        return Err(EncodeError::Field(error.unwrap_or(unnamed)));
    }
    if is_empty {
        writer.push(SEPARATOR);
    }
    if !after.is_empty() {
        (writer, _) = writer.fields(after, dialect.charset(), of)?;
    }
    let data = writer.length(available) - length_at - "00#".len();
    writer.word(u64::from(u16::from_le_bytes([DATA, END])), 2);
    let length = writer.length(available);
    if (10..100).contains(&data)
        && length <= Message::MAX_LEN
        && let (Some((digits, _)), Some([tens, ones, mark, ..])) =
            (text_of_length(data), out.get_mut(length_at..length))
    {
        [*tens, *ones, ..] = digits.to_le_bytes();
        *mark = DATA;
        return Ok(length);
    }
    set_length(out, length_at, length, data)
}

#[inline(always)]
fn text_of_length(length: usize) -> Option<(u64, usize)> {
    u32::try_from(length).ok().and_then(text_of)
}

/// Puts the length of a message's data and the mark after it in their place, where two digits and any mark are, and gives the length
/// of the message, which is written whole.
#[inline(never)]
fn set_length(out: &mut [u8], at: usize, length: usize, data: usize) -> Result<usize, EncodeError> {
    // A job that is longer than a packet has a length of four digits.
    let (digits, count) = text_of_length(data).unwrap_or((0, 8));
    let (needed, available) = (length + count - 2, out.len());
    if needed > Message::MAX_LEN {
        return Err(EncodeError::TooLong { length: needed, limit: Message::MAX_LEN });
    }
    // One of a single digit is written with two first.
    if needed.max(length) > available {
        return Err(EncodeError::BufferTooSmall { needed: needed.max(length), available });
    }
    let [first, ..] = digits.to_le_bytes();
    match out.get_mut(at..).and_then(<[u8]>::first_chunk_mut::<17>) {
        Some(place) if count == 1 => {
            // After its mark a message goes on for eleven bytes at most.
            place.copy_within(2.., 1);
            [place[0], place[1]] = [first, DATA];
        }
        _ => {
            out.copy_within(at + 2..length, at + count);
            let places = out.get_mut(at..=at + count).unwrap_or_default().iter_mut();
            let bytes = digits.to_le_bytes().into_iter().take(count).chain([DATA]);
            places.zip(bytes).for_each(|(place, byte)| *place = byte);
        }
    }
    Ok(needed)
}

/// Writes into what is left of a buffer, and counts what it has no room for.
struct Writer<'o> {
    rest: &'o mut [u8],
    missing: usize,
}

impl Writer<'_> {
    /// How many bytes of a buffer of this size are written, and how many more it would have to have.
    #[inline(always)]
    const fn length(&self, available: usize) -> usize {
        available - self.rest.len() + self.missing
    }

    /// What is before the job's own fields, whatever the table; where the length is, and which fields are after the job's own.
    #[cold]
    fn begin<'f>(
        mut self,
        dialect: &Dialect<'f>,
        available: usize,
        of: (u16, u16),
    ) -> Result<(Self, usize, &'f [Field<'f>]), EncodeError> {
        let (entry, charset) = (dialect.entry(Role::Job).ok_or(EncodeError::NoName)?, dialect.charset());
        self.push(START);
        self.characters(entry.name, charset)?;
        let (mut writer, _) = self.fields(entry.header, charset, of)?;
        writer.push(SEPARATOR);
        let length_at = writer.length(available);
        writer.word(u64::from(u16::from_le_bytes(*b"00")), 2);
        let (writer, after) = writer.fields(entry.fields, charset, of)?;
        Ok((writer, length_at, after))
    }

    /// Fields up to the job's own; which are after these.
    #[cold]
    fn fields<'f>(
        mut self,
        fields: &'f [Field<'f>],
        charset: Charset,
        (order, number): (u16, u16),
    ) -> Result<(Self, &'f [Field<'f>]), EncodeError> {
        let mut fields = fields.iter();
        for field in fields.by_ref() {
            match field {
                Field::Order => self.number(false, u32::from(order)),
                Field::Number => self.number(false, u32::from(number)),
                Field::Constant(text) => {
                    self.push(SEPARATOR);
                    self.characters(text, charset)?;
                }
                Field::Work => break,
                _ => self.push(SEPARATOR),
            }
        }
        Ok((self, fields.as_slice()))
    }

    #[inline(always)]
    fn head(&mut self, head: &Head) {
        if let Some(place) = self.rest.first_chunk_mut::<32>() {
            if let Some(begin) = place.first_chunk_mut() {
                *begin = *head.bytes();
            }
            self.skip(head.len());
        } else {
            self.append(head.bytes().iter().copied().take(head.len()));
        }
    }

    fn characters(&mut self, text: &str, charset: Charset) -> Result<(), EncodeError> {
        text.chars().try_for_each(|c| {
            self.push(charset.byte(c)?);
            Ok(())
        })
    }

    /// A number without decimals, and the mark before it.
    #[inline(always)]
    fn number(&mut self, is_negative: bool, number: u32) {
        match text_of(number) {
            Some(text) => self.digits(is_negative, text),
            None => self.spell(is_negative, digits(number, 0)),
        }
    }

    #[inline(always)]
    fn digits(&mut self, is_negative: bool, (text, length): (u64, usize)) {
        if let Some(place) = self.rest.first_chunk_mut::<16>() {
            // The first digit is written over a minus that is not there.
            let [first, second, ..] = place;
            (*first, *second) = (SEPARATOR, b'-');
            let at = 1 + usize::from(is_negative);
            if let Some(digits) = place.get_mut(at..).and_then(<[u8]>::first_chunk_mut) {
                *digits = text.to_le_bytes();
            }
            self.skip(at + length);
        } else {
            self.spell(is_negative, text.to_le_bytes().into_iter().take(length));
        }
    }

    /// A number with decimals, and the mark before it.
    #[inline(always)]
    fn decimal(&mut self, is_negative: bool, number: u32, places: u8) {
        let one = TENS.get(usize::from(places));
        // A point in place of the one.
        let decimals = one.and_then(|one| text_of(one + number % one));
        if let (Some(one), Some((text, length))) = (one, decimals) {
            self.number(is_negative, number / one);
            self.word(text ^ u64::from(b'1' ^ b'.'), length);
        } else {
            self.spell(is_negative, digits(number, places));
        }
    }

    #[inline(always)]
    fn push(&mut self, byte: u8) {
        match take(&mut self.rest).split_first_mut() {
            Some((place, rest)) => (*place, self.rest) = (byte, rest),
            None => self.missing += 1,
        }
    }

    /// So many of eight bytes, the lowest first. What is after them is written next.
    #[inline(always)]
    fn word(&mut self, word: u64, length: usize) {
        if let Some(place) = self.rest.first_chunk_mut() {
            *place = word.to_le_bytes();
            self.skip(length);
        } else {
            self.append(word.to_le_bytes().into_iter().take(length));
        }
    }

    /// So many bytes are written.
    #[inline(always)]
    fn skip(&mut self, length: usize) {
        self.rest = take(&mut self.rest).get_mut(length..).unwrap_or_default();
    }

    #[inline(always)]
    fn spell(&mut self, is_negative: bool, digits: impl Iterator<Item = u8>) {
        self.append(once(SEPARATOR).chain(is_negative.then_some(b'-')).chain(digits));
    }

    #[inline(always)]
    fn append(&mut self, bytes: impl Iterator<Item = u8>) {
        // By value: what a cold function writes to is kept in no register anywhere.
        (self.rest, self.missing) = append(take(&mut self.rest), self.missing, bytes);
    }
}

/// Byte by byte.
#[cold]
#[inline(never)]
fn append(mut rest: &mut [u8], mut missing: usize, bytes: impl Iterator<Item = u8>) -> (&mut [u8], usize) {
    for byte in bytes {
        match take(&mut rest).split_first_mut() {
            Some((place, others)) => (*place, rest) = (byte, others),
            None => missing += 1,
        }
    }
    (rest, missing)
}

/// One with so many decimals.
const TENS: [u32; 8] = [1, 10, 100, 1000, 10_000, 100_000, 1_000_000, 10_000_000];

/// A job's own fields, a mark before each.
struct Written<'o, 'e> {
    writer: Writer<'o>,
    charset: Charset,
    is_empty: bool,
    error: &'e mut Option<FieldError>,
}

impl Fields for Written<'_, '_> {
    #[inline(always)]
    fn decimal(
        &mut self,
        name: &str,
        value: &mut i32,
        places: u8,
        range: RangeInclusive<i32>,
    ) -> Result<(), Unfit> {
        let (min, max) = range.into_inner();
        let units = *value;
        if units < min || max < units {
            return Err(unfit(self.error, name, out_of_range(units, min, max, places)));
        }
        let (is_negative, number) = (units < 0, units.unsigned_abs());
        self.is_empty = false;
        match places {
            0 => self.writer.number(is_negative, number),
            _ => self.writer.decimal(is_negative, number, places),
        }
        Ok(())
    }

    #[inline(always)]
    fn text<const N: usize>(
        &mut self,
        name: &str,
        value: &mut Text<N>,
        length: RangeInclusive<usize>,
    ) -> Result<(), Unfit> {
        let (charset, found) = (self.charset, value.as_bytes().len());
        let (min, max) = length.into_inner();
        if found < min || max < found {
            let fault = FieldFault::Length { found, min, max: N.min(max) };
            return Err(unfit(self.error, name, fault));
        }
        self.is_empty = false;
        self.writer.push(SEPARATOR);
        for at in (0..found).step_by(8) {
            // No text holds a mark.
            let word = value.word(at);
            if word & 0x8080_8080_8080_8080 != 0
                && let Some(found) = value.chars().find(|c| charset.byte(*c).is_err())
            {
                return Err(unfit(self.error, name, FieldFault::Character { found }));
            }
            self.writer.word(word, (found - at).min(8));
        }
        Ok(())
    }

    fn refuse(&mut self, error: FieldError) -> Unfit {
        *self.error = Some(error);
        Unfit(())
    }
}

#[cold]
fn unfit(error: &mut Option<FieldError>, name: &str, fault: FieldFault) -> Unfit {
    *error = Some(FieldError { field: Name::of(name), fault });
    Unfit(())
}

#[cold]
fn out_of_range(found: i32, min: i32, max: i32, places: u8) -> FieldFault {
    let [found, min, max] = [found, min, max].map(|units| Decimal { units, places });
    FieldFault::OutOfRange { found, min, max }
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
