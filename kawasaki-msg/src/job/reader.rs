//! The one reader of a job's fields.
//!
//! A field as we write it is read eight bytes at once; any other that is allowed byte by byte, and so is one that is wrong,
//! which gives the error.

use core::ops::RangeInclusive;

use super::Text;
use super::layout::{self, LONGEST};
use super::work::{Decimal, Fields, Unfit, Work};
use crate::error::{FieldError, FieldFault, MessageError, Name};
use crate::value::{self, Charset, DATA, END, SEPARATOR, START, Value};

/// Eight bytes.
#[inline(always)]
pub(super) fn word<const WINDOW: usize>(window: &[u8; WINDOW], at: usize) -> Option<u64> {
    chunk(window, at).map(|bytes| u64::from_le_bytes(*bytes))
}

#[inline(always)]
pub(super) fn chunk<const N: usize, const WINDOW: usize>(
    window: &[u8; WINDOW],
    at: usize,
) -> Option<&[u8; N]> {
    window.get(at..)?.first_chunk()
}

/// The job in these values, which are all of its fields and nothing else.
///
/// # Errors
/// The first field that does not fit, or that there are more values than fields.
#[cold]
pub(crate) fn read_values<'v, W: Work>(
    values: impl Iterator<Item = Value<'v>>,
    ranges: &W::Ranges,
    charset: Charset,
) -> Result<W, MessageError> {
    let (mut window, mut end, mut found) = ([0; LONGEST], 0, 0);
    let mut put = |byte| {
        if let Some(place) = window.get_mut(end) {
            *place = byte;
        }
        end += 1;
    };
    for value in values {
        put(SEPARATOR);
        match value {
            Value::Wire(wire) => wire.iter().copied().for_each(&mut put),
            value => value.chars().for_each(|c| put(u8::try_from(c).unwrap_or(START))),
        }
        found += 1;
    }
    put(DATA);
    put(END);
    if end > LONGEST {
        return Err(MessageError::JobTooLong { found: end, limit: LONGEST });
    }
    let swar = Swar::new(charset);
    let mut reader = Reader::<LONGEST, true>::new(&window, 0, charset, &swar);
    let mut work = W::default();
    match (work.fields(ranges, &mut reader), reader.error) {
        (Ok(()), _) if reader.at + 2 == end => Ok(work),
        (Err(Unfit(())), Some(error)) => Err(MessageError::Field(error)),
        _ => Err(MessageError::FieldCount { expected: layout::count::<W>(ranges), found }),
    }
}

/// Reads one field after the other. The one for expected jobs reads what is written as we write it, and leaves all else to the
/// one that explains: that reads every form which is allowed, and keeps the error.
///
/// Its window is an array: what is looked at is checked against a constant.
pub(super) struct Reader<'a, const WINDOW: usize, const EXPLAINS: bool> {
    window: &'a [u8; WINDOW],
    /// The place of the mark before the next field.
    at: usize,
    charset: Charset,
    swar: &'a Swar,
    error: Option<FieldError>,
}

impl<'a, const WINDOW: usize> Reader<'a, WINDOW, false> {
    /// Reads the job whose first field is after the mark at a place, and gives the place of the mark after its last one.
    #[inline(always)]
    pub(super) fn read<W: Work>(
        window: &'a [u8; WINDOW],
        at: usize,
        charset: Charset,
        swar: &'a Swar,
        ranges: &W::Ranges,
        work: &mut W,
    ) -> Option<usize> {
        let mut reader = Self::new(window, at, charset, swar);
        work.fields(ranges, &mut reader).ok()?;
        Some(reader.at)
    }
}

impl<const WINDOW: usize, const EXPLAINS: bool> Fields for Reader<'_, WINDOW, EXPLAINS> {
    #[inline(always)]
    fn decimal(
        &mut self,
        name: &str,
        value: &mut i32,
        places: u8,
        range: RangeInclusive<i32>,
    ) -> Result<(), Unfit> {
        let (min, max) = range.into_inner();
        let (number, at) = match self.quick_decimal(places) {
            Some((number, at)) if min <= number && number <= max => (number, at),
            _ if !EXPLAINS => return Err(Unfit(())),
            _ => match slow_decimal(self.window, self.at, places, (min, max)) {
                Ok(read) => read,
                Err(fault) => return Err(self.unfit(name, fault)),
            },
        };
        (*value, self.at) = (number, at);
        Ok(())
    }

    /// A code is most often a single digit.
    #[inline(always)]
    fn whole<T: Copy + Into<i32> + TryFrom<i32>>(
        &mut self,
        name: &str,
        value: &mut T,
        range: RangeInclusive<T>,
    ) -> Result<(), Unfit> {
        let (min, max) = range.into_inner();
        let (min, max) = (min.into(), max.into());
        if size_of::<T>() == 1
            && max <= 9
            && let Some(digit @ b'0'..=b'9') = self.window.get(self.at + 1)
            && is_mark(self.window, self.at + 2)
            && (min..=max).contains(&i32::from(digit - b'0'))
            && let Ok(number) = T::try_from(i32::from(digit - b'0'))
        {
            (*value, self.at) = (number, self.at + 2);
            return Ok(());
        }
        let mut number = 0;
        self.decimal(name, &mut number, 0, min..=max)?;
        match T::try_from(number) {
            Ok(number) => *value = number,
            Err(_) => return Err(self.unfit(name, FieldFault::Value { found: number })),
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
        let (min, max) = length.into_inner();
        match self.quick_text(value) {
            Some(at) if (min..=max).contains(&(at - self.at - 1)) => self.at = at,
            _ if !EXPLAINS => return Err(Unfit(())),
            _ => {
                let fault = slow_text(self.window, self.at, self.charset, (min, max.min(N)));
                return Err(self.unfit(name, fault));
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn refuse(&mut self, error: FieldError) -> Unfit {
        if EXPLAINS {
            self.error = Some(error);
        }
        Unfit(())
    }
}

impl<'a, const WINDOW: usize, const EXPLAINS: bool> Reader<'a, WINDOW, EXPLAINS> {
    #[inline(always)]
    fn new(window: &'a [u8; WINDOW], at: usize, charset: Charset, swar: &'a Swar) -> Self {
        Self { window, at, charset, swar, error: None }
    }

    #[inline(always)]
    fn unfit(&mut self, name: &str, fault: FieldFault) -> Unfit {
        if EXPLAINS {
            self.error = Some(FieldError { field: Name::of(name), fault });
        }
        Unfit(())
    }

    /// A number as we write it, and the place of the mark after it.
    #[inline(always)]
    fn quick_decimal(&self, places: u8) -> Option<(i32, usize)> {
        let (window, swar) = (self.window, self.swar);
        // One check for every place below.
        if self.at > const { WINDOW.saturating_sub(32) } {
            return None;
        }
        // -1 where a minus is, else 0.
        let minus = ((isize::from(*window.get(self.at + 1)?) ^ isize::from(b'-')) - 1) >> (isize::BITS - 1);
        let at = (self.at + 1).wrapping_sub(minus.cast_unsigned());
        let first = word(window, at)?;
        let short = if places == 0 { swar.whole(first) } else { swar.decimal(first, places) };
        let (number, length) = match short {
            Some(read) => read,
            // The remainder is the length itself: it only shows its bound.
            None => long_decimal(window, at, places).map(|(number, length)| (number, length % 16))?,
        };
        let mark = at + length;
        #[expect(clippy::cast_possible_truncation, reason = "it is 0 or -1")]
        let minus = minus as i32;
        is_mark(window, mark).then_some(((number ^ minus) - minus, mark))
    }

    /// Text without a byte that it cannot hold; the place of the mark after it.
    #[inline(always)]
    fn quick_text<const N: usize>(&self, text: &mut Text<N>) -> Option<usize> {
        let mut length = 0;
        *text = Text::EMPTY;
        while length <= N {
            let at = self.at + 1 + length;
            let next = word(self.window, at)?;
            let ends = self.swar.marks(next) | next & self.swar.not_characters;
            if ends == 0 {
                text.put(length, next);
                length += 8;
                continue;
            }
            let bits = ends.trailing_zeros() & 0x38;
            text.put(length, next & !(u64::MAX << bits));
            length += bits as usize / 8;
            text.set_length(length)?;
            let mark = at + bits as usize / 8;
            return is_mark(self.window, mark).then_some(mark);
        }
        None
    }
}

/// Whether another field follows, or nothing.
#[inline(always)]
fn is_mark<const WINDOW: usize>(window: &[u8; WINDOW], at: usize) -> bool {
    window.get(at) == Some(&SEPARATOR) || chunk(window, at) == Some(&[DATA, END])
}

/// A number of more than seven bytes, without its sign, and how many bytes it is.
#[cold]
#[inline(never)]
fn long_decimal<const WINDOW: usize>(window: &[u8; WINDOW], at: usize, places: u8) -> Option<(i32, usize)> {
    let (mut number, mut point) = (0i32, None);
    for (length, byte) in chunk::<12, WINDOW>(window, at)?.iter().enumerate() {
        match (byte, point) {
            (b'0'..=b'9', _) => {
                number = number.checked_mul(10)?.checked_add(i32::from(byte - b'0'))?;
            }
            (b'.', None) => point = Some(length),
            _ => {
                let decimals = point.map(|point| length - point - 1);
                let as_written = (places > 0).then_some(usize::from(places));
                return (length > 0 && decimals == as_written).then_some((number, length));
            }
        }
    }
    None
}

/// The bytes between the mark at a place and the next one; `None` when no field is there.
fn value_after(window: &[u8], at: usize) -> Option<&[u8]> {
    let [SEPARATOR, rest @ ..] = window.get(at..)? else { return None };
    rest.split(|byte| matches!(*byte, SEPARATOR | DATA)).next()
}

/// A number in any form that is allowed.
#[cold]
#[inline(never)]
fn slow_decimal(
    window: &[u8],
    at: usize,
    places: u8,
    (min, max): (i32, i32),
) -> Result<(i32, usize), FieldFault> {
    let text = value_after(window, at).ok_or(FieldFault::Missing)?;
    let decimal = |units| Decimal { units, places };
    let not_a_number = FieldFault::NotANumber { min: decimal(min), max: decimal(max) };
    let number = text.trim_ascii();
    let (negative, number) = number.strip_prefix(b"-").map_or((false, number), |rest| (true, rest));
    let point = number.iter().position(|byte| *byte == b'.').filter(|_| places > 0);
    let (whole, decimals) = number.split_at(point.unwrap_or(number.len()));
    let decimals = decimals.get(1..).unwrap_or_default();
    let mut digits = whole.iter().chain(decimals);
    if whole.len() + decimals.len() == 0 || !digits.all(u8::is_ascii_digit) {
        return Err(not_a_number);
    }
    let (kept, rest) = decimals.split_at(decimals.len().min(usize::from(places)));
    if rest.iter().any(|digit| *digit != b'0') {
        return Err(FieldFault::TooPrecise { places });
    }
    let zeros = core::iter::repeat_n(&b'0', usize::from(places) - kept.len());
    let units = whole.iter().chain(kept).chain(zeros).try_fold(0i32, |units, digit| {
        let (units, digit) = (units.checked_mul(10)?, i32::from(digit - b'0'));
        if negative { units.checked_sub(digit) } else { units.checked_add(digit) }
    });
    let units = units.ok_or(not_a_number)?;
    if !(min..=max).contains(&units) {
        return Err(FieldFault::OutOfRange { found: decimal(units), min: decimal(min), max: decimal(max) });
    }
    Ok((units, at + 1 + text.len()))
}

/// What is wrong with a text.
#[cold]
#[inline(never)]
fn slow_text(window: &[u8], at: usize, charset: Charset, (min, max): (usize, usize)) -> FieldFault {
    let Some(text) = value_after(window, at) else { return FieldFault::Missing };
    match text.iter().copied().find(|byte| value::is_mark(*byte) || !charset.has(*byte)) {
        Some(found) if value::is_mark(found) => FieldFault::Reserved { found },
        Some(found) => FieldFault::Character { found: char::from(found) },
        None => FieldFault::Length { found: text.len(), min, max },
    }
}

/// What eight bytes are calculated with, as data: every one of these as an immediate would take an instruction more.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Swar {
    ones: u64,
    zeros: u64,
    above_nine: u64,
    tops: u64,
    pairs: u64,
    fours: u64,
    eights: u64,
    sevens: u64,
    separators: u64,
    data: u64,
    starts: u64,
    not_characters: u64,
    point: u64,
    byte: u64,
}

impl Swar {
    pub(super) const fn new(charset: Charset) -> Self {
        Self {
            ones: ONES,
            zeros: 0x30 * ONES,
            above_nine: 0x76 * ONES,
            tops: 0x80 * ONES,
            pairs: 0x00FF_00FF_00FF_00FF,
            fours: 0x0000_FFFF_0000_FFFF,
            eights: (10_000 << 32) + 1,
            sevens: (1_000 << 32) + 1,
            separators: SEPARATOR as u64 * ONES,
            data: DATA as u64 * ONES,
            starts: START as u64 * ONES,
            not_characters: if matches!(charset, Charset::Ascii) { 0x80 * ONES } else { 0 },
            point: (b'.' ^ b'0') as u64,
            byte: 0xFF,
        }
    }

    /// The top bit of each byte that is no digit, and the digits' values.
    #[inline(always)]
    fn others(&self, word: u64) -> (u64, u64) {
        // A digit becomes its value; the sum reaches the top bit of a byte from 10 on.
        let values = word ^ self.zeros;
        ((values.wrapping_add(self.above_nine) | values) & self.tops, values)
    }

    /// One to seven digits at the beginning: their value and how many they are.
    #[inline(always)]
    fn whole(&self, word: u64) -> Option<(i32, usize)> {
        let (others, values) = self.others(word);
        if others == 0 {
            return None;
        }
        let top_bit = others.trailing_zeros();
        // Modulo 64: what moves the last digit to the highest byte; zeros are then before the first one.
        let shift = 7u32.wrapping_sub(top_bit);
        (shift != 0).then(|| (self.join(values.wrapping_shl(shift), 4), top_bit as usize / 8))
    }

    /// Digits, a point, and so many digits, seven bytes at most: their value, and how many bytes they are.
    #[inline(always)]
    fn decimal(&self, word: u64, places: u8) -> Option<(i32, usize)> {
        let (others, values) = self.others(word);
        let after_point = others & others.wrapping_sub(1);
        if after_point == 0 {
            return None;
        }
        let top_bit = after_point.trailing_zeros();
        // The last byte highest: then the point has its place, where it becomes 0.
        let aligned = values.wrapping_shl(7u32.wrapping_sub(top_bit));
        let place = 56u32.checked_sub(8 * u32::from(places))?;
        let digits = aligned ^ self.point << place;
        if digits & self.byte << place != 0 {
            return None;
        }
        let number = if places == 3 {
            self.join(digits, 3)
        } else {
            let (whole, decimals) = (digits & !(u64::MAX << place), digits & u64::MAX << place);
            self.join(decimals | whole << 8, 4)
        };
        Some((number, top_bit as usize / 8))
    }

    /// The number of eight digits, the first one lowest; of the last four so many count, the one before them being 0.
    #[inline(always)]
    fn join(&self, digits: u64, last: u8) -> i32 {
        // Pairs, fours and eights are joined.
        let pairs = (digits.wrapping_mul((10 << 8) + 1) >> 8) & self.pairs;
        let fours = (pairs.wrapping_mul((100 << 16) + 1) >> 16) & self.fours;
        let eights = if last == 4 { self.eights } else { self.sevens };
        ((fours.wrapping_mul(eights) >> 32) as u32).cast_signed()
    }

    /// The top bit of each byte that is a mark, up to the first; above it there may be others.
    #[inline(always)]
    fn marks(&self, word: u64) -> u64 {
        let equal = |different: u64| different.wrapping_sub(self.ones) & !different;
        // The begin and the end mark differ in one bit.
        let ends = (word & !(self.ones << 1)) ^ self.starts;
        (equal(word ^ self.separators) | equal(word ^ self.data) | equal(ends)) & self.tops
    }
}

/// 1 in each byte.
const ONES: u64 = 0x0101_0101_0101_0101;
