//! The fields that messages are made of, each read beside where it is written.

use crate::{Angle, DecodeError, Dialect, EncodeError, Expected, Length};

/// Reads one field after the other from a line.
#[derive(Debug)]
pub struct Reader<'a> {
    line: &'a [u8],
    rest: &'a [u8],
    dialect: &'a Dialect,
}

/// Writes one field after the other into a buffer that is long enough.
#[derive(Debug)]
pub struct Writer<'a> {
    rest: &'a mut [u8],
    axis: usize,
}

impl<'a> Reader<'a> {
    pub(crate) fn new(line: &'a [u8], dialect: &'a Dialect) -> Self {
        Self { line, rest: line, dialect }
    }

    pub(crate) fn dialect(&self) -> &Dialect {
        self.dialect
    }

    pub(crate) fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// Where the next field begins in the line.
    pub(crate) fn offset(&self) -> usize {
        self.line.len() - self.rest.len()
    }

    pub(crate) fn take<const N: usize>(&mut self, expected: Expected) -> Result<&'a [u8; N], DecodeError> {
        match self.rest.split_first_chunk() {
            Some((chunk, rest)) => {
                self.rest = rest;
                Ok(chunk)
            }
            None => Err(DecodeError::Short { offset: self.line.len(), expected }),
        }
    }

    /// A length: `Sxxx.yyy`, millimetres.
    pub(crate) fn length(&mut self) -> Result<Length, DecodeError> {
        self.decimal(LENGTH).map(Length::from_um)
    }

    /// An angle: `Sxx.yyyy`, radians.
    pub(crate) fn angle(&mut self) -> Result<Angle, DecodeError> {
        self.decimal(ANGLE).map(Angle::from_tenths_mrad)
    }

    /// An integer: a sign and five digits.
    pub(crate) fn integer(&mut self) -> Result<i32, DecodeError> {
        let offset = self.offset();
        if self.dialect.blank && matches!(self.rest, [b'+' | b'-', b' ', ..]) {
            return self.integer_behind_a_blank();
        }
        let Some((field, rest)) = self.rest.split_first_chunk::<6>() else {
            return Err(self.misfit(INTEGER));
        };
        let Some(value) = INTEGER.value(widen(*field)) else { return Err(self.misfit(INTEGER)) };
        self.rest = rest;
        self.check_range(offset, value)
    }

    /// `T` or `F`.
    pub(crate) fn flag(&mut self) -> Result<bool, DecodeError> {
        let offset = self.offset();
        match self.take(Expected::TrueOrFalse)? {
            b"T" => Ok(true),
            b"F" => Ok(false),
            &[found] => Err(DecodeError::Unexpected { offset, found, expected: Expected::TrueOrFalse }),
        }
    }

    /// The override: an integer from 0 to 100.
    pub(crate) fn percent(&mut self) -> Result<u8, DecodeError> {
        let offset = self.offset();
        let found = self.integer()?;
        match u8::try_from(found) {
            Ok(percent) if percent <= 100 => Ok(percent),
            _ => Err(DecodeError::Percent { offset, found }),
        }
    }

    /// The rest of the line, which is one of `words`.
    pub(crate) fn word<T: Copy>(
        &mut self,
        words: &[(&[u8], T)],
        expected: Expected,
    ) -> Result<T, DecodeError> {
        let (offset, rest) = (self.offset(), self.rest);
        if let Some((_, value)) = words.iter().find(|(word, _)| *word == rest) {
            self.rest = &[];
            return Ok(*value);
        }
        if let Some((word, _)) = words.iter().find(|(word, _)| rest.starts_with(word)) {
            return Err(DecodeError::Trailing { offset: offset + word.len() });
        }
        match rest.first() {
            Some(&found) if !words.iter().any(|(word, _)| word.starts_with(rest)) => {
                Err(DecodeError::Unexpected { offset, found, expected })
            }
            _ => Err(DecodeError::Short { offset: self.line.len(), expected }),
        }
    }

    pub(crate) fn end(&self) -> Result<(), DecodeError> {
        if self.rest.is_empty() { Ok(()) } else { Err(DecodeError::Trailing { offset: self.offset() }) }
    }

    fn decimal(&mut self, format: Format) -> Result<i32, DecodeError> {
        let Some((field, rest)) = self.rest.split_first_chunk::<8>() else {
            return Err(self.misfit(format));
        };
        let Some(value) = format.value(u64::from_be_bytes(*field)) else { return Err(self.misfit(format)) };
        self.rest = rest;
        Ok(value)
    }

    #[cold]
    fn integer_behind_a_blank(&mut self) -> Result<i32, DecodeError> {
        let offset = self.offset();
        let Some(([sign, _, a, b, c, d, e], rest)) = self.rest.split_first_chunk::<7>() else {
            return Err(self.misfit(INTEGER));
        };
        let field = [*sign, *a, *b, *c, *d, *e];
        let Some(value) = INTEGER.value(widen(field)) else { return Err(self.misfit(INTEGER)) };
        self.rest = rest;
        self.check_range(offset, value)
    }

    fn check_range(&self, offset: usize, found: i32) -> Result<i32, DecodeError> {
        if i16::try_from(found).is_ok() || self.dialect.wide_integers {
            Ok(found)
        } else {
            Err(DecodeError::IntegerRange { offset, found })
        }
    }

    /// The first character of the field here that does not fit its format.
    #[cold]
    fn misfit(&self, format: Format) -> DecodeError {
        let mut offset = self.offset();
        let mut characters = self.rest.iter();
        for (i, &expected) in format.layout().iter().enumerate() {
            if i == 1
                && self.dialect.blank
                && format.point.is_none()
                && characters.as_slice().starts_with(b" ")
            {
                characters.next();
                offset += 1;
            }
            match characters.next() {
                None => return DecodeError::Short { offset, expected },
                Some(&found) if !expected.allows(found) => {
                    return DecodeError::Unexpected { offset, found, expected };
                }
                Some(_) => offset += 1,
            }
        }
        DecodeError::Trailing { offset }
    }
}

impl<'a> Writer<'a> {
    /// A writer of `needed` bytes at the beginning of `buffer`.
    pub(crate) fn new(buffer: &'a mut [u8], needed: usize) -> Result<Self, EncodeError> {
        let found = buffer.len();
        let rest = buffer.get_mut(..needed).ok_or(EncodeError::Buffer { needed, found })?;
        Ok(Self { rest, axis: 0 })
    }

    pub(crate) fn put<const N: usize>(&mut self, bytes: &[u8; N]) {
        if let Some((to, rest)) = core::mem::take(&mut self.rest).split_first_chunk_mut() {
            *to = *bytes;
            self.rest = rest;
        }
    }

    pub(crate) fn length(&mut self, length: Length) -> Result<(), EncodeError> {
        self.decimal(LENGTH, length.um())
    }

    pub(crate) fn angle(&mut self, angle: Angle) -> Result<(), EncodeError> {
        self.decimal(ANGLE, angle.tenths_mrad())
    }

    pub(crate) fn integer(&mut self, found: i32) -> Result<(), EncodeError> {
        if i16::try_from(found).is_err() {
            return Err(EncodeError::IntegerRange { found });
        }
        let [_, _, field @ ..] = INTEGER.text(found).to_be_bytes();
        self.put(&field);
        Ok(())
    }

    pub(crate) fn flag(&mut self, flag: bool) {
        self.put(if flag { b"T" } else { b"F" });
    }

    pub(crate) fn percent(&mut self, found: u8) -> Result<(), EncodeError> {
        if found > 100 { Err(EncodeError::Percent { found }) } else { self.integer(found.into()) }
    }

    fn decimal(&mut self, format: Format, found: i32) -> Result<(), EncodeError> {
        if found.unsigned_abs() > 999_999 {
            return Err(EncodeError::AxisRange { axis: self.axis, found });
        }
        self.axis += 1;
        self.put(&format.text(found).to_be_bytes());
        Ok(())
    }
}

/// A sign, digits, and a point behind so many of them from the right; read as one word, its last character lowest.
#[derive(Debug, Clone, Copy)]
struct Format {
    /// The field with the value +0.
    zero: u64,
    /// The bits of the digits behind the point.
    point: Option<u32>,
}

const LENGTH: Format = Format { zero: u64::from_be_bytes(*b"+000.000"), point: Some(24) };
const ANGLE: Format = Format { zero: u64::from_be_bytes(*b"+00.0000"), point: Some(32) };
const INTEGER: Format = Format { zero: widen(*b"+00000"), point: None };

const ONES: u64 = u64::MAX / 0xFF;

impl Format {
    /// The value of a field, in units of its last digit; `None` when a character does not fit.
    #[inline]
    fn value(self, field: u64) -> Option<i32> {
        let word = field ^ self.zero;
        let sign_at = if self.point.is_some() { 56 } else { 40 };
        let (sign, word) = (word >> sign_at, word & ((1 << sign_at) - 1));
        // A digit is 0 to 9 now: above that, adding 76h sets the high bit. A point is 0: the limit there is 7Fh.
        let limit = self.point.map_or(ONES * 0x76, |bits| ONES * 0x76 + (0x09 << bits));
        if (word | word.wrapping_add(limit)) & (ONES << 7) != 0 || (sign != 0 && sign != PLUS ^ MINUS) {
            return None;
        }
        let digits = match self.point {
            Some(bits) => {
                let behind = (1 << bits) - 1;
                (word >> 8 & !behind) | (word & behind)
            }
            None => word,
        };
        let value = number(digits);
        Some(if sign == 0 { value } else { -value })
    }

    /// The field of a value that fits.
    fn text(self, value: i32) -> u64 {
        let mut rest = value.unsigned_abs();
        let (mut digits, mut shift) = (0u64, 0);
        while rest > 0 {
            digits |= u64::from(rest % 10) << shift;
            rest /= 10;
            shift += 8;
        }
        let word = match self.point {
            Some(bits) => {
                let behind = (1 << bits) - 1;
                (digits & !behind) << 8 | (digits & behind)
            }
            None => digits,
        };
        let sign_at = if self.point.is_some() { 56 } else { 40 };
        let sign = if value < 0 { (PLUS ^ MINUS) << sign_at } else { 0 };
        self.zero ^ word ^ sign
    }

    fn layout(self) -> &'static [Expected] {
        use Expected::{Digit, Point, Sign};
        match self.point {
            Some(24) => &[Sign, Digit, Digit, Digit, Point, Digit, Digit, Digit],
            Some(_) => &[Sign, Digit, Digit, Point, Digit, Digit, Digit, Digit],
            None => &[Sign, Digit, Digit, Digit, Digit, Digit],
        }
    }
}

const PLUS: u64 = b'+' as u64;
const MINUS: u64 = b'-' as u64;

/// Up to eight digits, one a byte, the last one lowest: neighbours are added in pairs, three times.
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "eight digits are below 2^31")]
const fn number(digits: u64) -> i32 {
    let pairs = (digits >> 8 & 0x00FF_00FF_00FF_00FF) * 10 + (digits & 0x00FF_00FF_00FF_00FF);
    let fours = (pairs >> 16 & 0x0000_FFFF_0000_FFFF) * 100 + (pairs & 0x0000_FFFF_0000_FFFF);
    ((fours >> 32) * 10_000 + (fours & 0xFFFF_FFFF)) as i32
}

const fn widen([a, b, c, d, e, f]: [u8; 6]) -> u64 {
    u64::from_be_bytes([0, 0, a, b, c, d, e, f])
}

impl Expected {
    fn allows(self, found: u8) -> bool {
        match self {
            Self::Sign => matches!(found, b'+' | b'-'),
            Self::Digit => found.is_ascii_digit(),
            Self::Point => found == b'.',
            _ => false,
        }
    }
}
