//! The fields of messages, each with its decoder next to its encoder.

use crate::dialect::Dialect;
use crate::error::{DecodeError, EncodeError, Expected};
use crate::format::{ANGLE, Format, INTEGER, LENGTH};

/// Reads one field after the other from a line.
///
/// The fields of a strict peer are read without regard to the dialect; only other fields are examined a second time.
#[derive(Debug, Clone, Copy)]
pub struct Reader<'a> {
    line: &'a [u8],
    at: usize,
    dialect: &'a Dialect,
}

/// Writes one field after the other into a buffer that is long enough.
#[derive(Debug)]
pub struct Writer<'a> {
    rest: &'a mut [u8],
    dialect: &'a Dialect,
}

impl<'a> Reader<'a> {
    pub(crate) fn new(line: &'a [u8], dialect: &'a Dialect) -> Self {
        Self { line, at: 0, dialect }
    }

    pub(crate) fn dialect(&self) -> &Dialect {
        self.dialect
    }

    pub(crate) fn rest(&self) -> &'a [u8] {
        self.line.get(self.at..).unwrap_or_default()
    }

    /// Returns the offset of the next field in the line.
    pub(crate) fn offset(&self) -> usize {
        self.at
    }

    #[inline(always)]
    pub(crate) fn take<const N: usize>(&mut self, expected: Expected) -> Result<&'a [u8; N], DecodeError> {
        let chunk =
            self.rest().first_chunk().ok_or(DecodeError::Short { offset: self.line.len(), expected })?;
        self.at += N;
        Ok(chunk)
    }

    /// Coordinates in units of their last digit.
    #[inline(always)]
    pub(crate) fn coordinates<const N: usize>(
        &mut self,
        formats: &'static [Format; N],
    ) -> Result<[i32; N], DecodeError> {
        let (fields, _) = self.rest().as_chunks();
        let Some(fields) = fields.first_chunk::<N>() else { return Err(self.misfit(formats)) };
        let (mut values, mut misfits) = ([0; N], 0);
        for ((value, format), field) in values.iter_mut().zip(formats).zip(fields) {
            let misfit;
            (*value, misfit) = format.value(u64::from_le_bytes(*field));
            misfits |= misfit;
        }
        if misfits != 0 {
            return Err(self.misfit(formats));
        }
        self.at += 8 * N;
        Ok(values)
    }

    /// Reads an integer: a sign and five digits.
    #[inline(always)]
    pub(crate) fn integer(&mut self) -> Result<i32, DecodeError> {
        let (value, at) = match self.strict_integer() {
            Some((value, 0)) if i16::try_from(value).is_ok() => (value, self.at + 6),
            _ => self.any_integer()?,
        };
        self.at = at;
        Ok(value)
    }

    /// Reads the override: an integer from 0 to 100.
    pub(crate) fn percent(&mut self) -> Result<u8, DecodeError> {
        let offset = self.at;
        let found = self.integer()?;
        match u8::try_from(found) {
            Ok(percent) if percent <= 100 => Ok(percent),
            _ => Err(DecodeError::Percent { offset, found }),
        }
    }

    /// Reads the override and the number of an error, which end a status. If they do not fit, decodes them a second time to
    /// find the error.
    #[inline(always)]
    pub(crate) fn percent_and_error(&mut self) -> Result<(u8, i32), DecodeError> {
        if let Some([percent, error]) = self.two_words()
            && INTEGER.is_zero(error)
            && let (percent @ 0..=100, 0) = INTEGER.number(percent)
        {
            self.at += 12;
            return Ok((percent.to_le_bytes()[0], 0));
        }
        let (values, at) = self.any_percent_and_error()?;
        self.at = at;
        Ok(values)
    }

    /// Reads `T` or `F`.
    #[inline(always)]
    pub(crate) fn flag(&mut self) -> Result<bool, DecodeError> {
        let offset = self.offset();
        match *self.take(Expected::TrueOrFalse)? {
            [b'T'] => Ok(true),
            [b'F'] => Ok(false),
            [found] => Err(DecodeError::Unexpected { offset, found, expected: Expected::TrueOrFalse }),
        }
    }

    /// Reads the rest of the line, which must be one of `words`.
    pub(crate) fn word<T: Copy>(
        &mut self,
        words: &[(&[u8], T)],
        expected: Expected,
    ) -> Result<T, DecodeError> {
        let rest = self.rest();
        if let Some((_, value)) = words.iter().find(|(word, _)| *word == rest) {
            self.at = self.line.len();
            return Ok(*value);
        }
        if let Some((word, _)) = words.iter().find(|(word, _)| rest.starts_with(word)) {
            return Err(DecodeError::Trailing { offset: self.at + word.len() });
        }
        match rest.first() {
            Some(&found) if !words.iter().any(|(word, _)| word.starts_with(rest)) => {
                Err(DecodeError::Unexpected { offset: self.at, found, expected })
            }
            _ => Err(DecodeError::Short { offset: self.line.len(), expected }),
        }
    }

    #[inline(always)]
    pub(crate) fn end(&self) -> Result<(), DecodeError> {
        if self.at == self.line.len() { Ok(()) } else { Err(DecodeError::Trailing { offset: self.at }) }
    }

    /// Returns the integer that begins here, and 0 if its characters fit. Two characters precede every integer: with them it
    /// fills a word.
    #[inline(always)]
    fn strict_integer(self) -> Option<(i32, u64)> {
        let word = self.line.get(self.at.checked_sub(2)?..)?.first_chunk()?;
        Some(INTEGER.value(u64::from_le_bytes(*word)))
    }

    /// Returns this integer and the next one, with the two characters before each.
    #[inline(always)]
    fn two_words(self) -> Option<[u64; 2]> {
        let words: &[u8; 14] = self.line.get(self.at.checked_sub(2)?..)?.first_chunk()?;
        Some([u64::from_le_bytes(*words.first_chunk()?), u64::from_le_bytes(*words.last_chunk()?)])
    }

    /// Returns an integer in any dialect, or the error.
    #[cold]
    fn any_integer(self) -> Result<(i32, usize), DecodeError> {
        let misfit = self.misfit(&INTEGERS);
        let (sign, digits) = match self.rest() {
            [sign @ (b'+' | b'-'), b' ', digits @ ..] if self.dialect.blank => (sign, digits),
            [sign, digits @ ..] => (sign, digits),
            [] => return Err(misfit),
        };
        let Some([a, b, c, d, e]) = digits.first_chunk() else { return Err(misfit) };
        match INTEGER.value(u64::from_le_bytes([0, 0, *sign, *a, *b, *c, *d, *e])) {
            (found, 0) if i16::try_from(found).is_err() && !self.dialect.wide_integers => {
                Err(DecodeError::IntegerRange { offset: self.at, found })
            }
            (found, 0) => Ok((found, self.line.len() - digits.len() + 5)),
            _ => Err(misfit),
        }
    }

    #[cold]
    fn any_percent_and_error(mut self) -> Result<((u8, i32), usize), DecodeError> {
        let values = (self.percent()?, self.integer()?);
        Ok((values, self.at))
    }

    /// Returns the error of the first character that does not fit these fields.
    #[cold]
    fn misfit(self, formats: &'static [Format]) -> DecodeError {
        let (mut offset, mut characters) = (self.at, self.rest());
        for format in formats {
            for (i, &expected) in format.layout().iter().enumerate() {
                if let (1, true, [b' ', after @ ..]) = (i, self.blank_allowed(format), characters) {
                    (characters, offset) = (after, offset + 1);
                }
                match characters {
                    [] => return DecodeError::Short { offset, expected },
                    [found, ..] if !expected.allows(*found) => {
                        return DecodeError::Unexpected { offset, found: *found, expected };
                    }
                    [_, after @ ..] => (characters, offset) = (after, offset + 1),
                }
            }
        }
        DecodeError::Trailing { offset }
    }

    fn blank_allowed(self, format: &Format) -> bool {
        self.dialect.blank && !format.layout().contains(&Expected::Point)
    }
}

impl<'a> Writer<'a> {
    /// Creates a writer of `needed` bytes at the beginning of `buffer`.
    pub(crate) fn new(
        buffer: &'a mut [u8],
        needed: usize,
        dialect: &'a Dialect,
    ) -> Result<Self, EncodeError> {
        let found = buffer.len();
        let rest = buffer.get_mut(..needed).ok_or(EncodeError::Buffer { needed, found })?;
        Ok(Self { rest, dialect })
    }

    pub(crate) fn put<const N: usize>(&mut self, bytes: &[u8; N]) {
        if let Some((to, rest)) = core::mem::take(&mut self.rest).split_first_chunk_mut() {
            *to = *bytes;
            self.rest = rest;
        }
    }

    /// Coordinates in units of their last digit.
    #[inline(always)]
    pub(crate) fn coordinates<const N: usize>(
        &mut self,
        formats: &'static [Format; N],
        values: [i32; N],
    ) -> Result<(), EncodeError> {
        for (axis, (format, found)) in formats.iter().zip(values).enumerate() {
            if !coordinate_fits(found) {
                return Err(EncodeError::AxisRange { axis, found });
            }
            self.put(&format.text(found).to_le_bytes());
        }
        Ok(())
    }

    pub(crate) fn integer(&mut self, found: i32) -> Result<(), EncodeError> {
        if !integer_fits(found, self.dialect) {
            return Err(EncodeError::IntegerRange { found });
        }
        let [_, _, sign, digits @ ..] = INTEGER.text(found).to_le_bytes();
        self.put(&[sign]);
        if self.dialect.blank {
            self.put(b" ");
        }
        self.put(&digits);
        Ok(())
    }

    /// Writes the end of the line.
    pub(crate) fn end(&mut self) {
        if self.dialect.lone_lf { self.put(b"\n") } else { self.put(b"\r\n") }
    }

    pub(crate) fn flag(&mut self, flag: bool) {
        self.put(if flag { b"T" } else { b"F" });
    }

    pub(crate) fn percent(&mut self, found: u8) -> Result<(), EncodeError> {
        if found > 100 { Err(EncodeError::Percent { found }) } else { self.integer(found.into()) }
    }
}

/// Returns whether a coordinate in units of its last digit has a form on the wire.
pub(crate) fn coordinate_fits(value: i32) -> bool {
    value.unsigned_abs() <= 999_999
}

/// Returns whether an integer has a form on the wire.
pub(crate) fn integer_fits(value: i32, dialect: &Dialect) -> bool {
    i16::try_from(value).is_ok() || dialect.wide_integers && value.unsigned_abs() <= 99_999
}

/// Returns the length of an integer, in bytes.
pub(crate) fn integer_len(dialect: &Dialect) -> usize {
    6 + usize::from(dialect.blank)
}

/// Returns the length of the end of a line, in bytes.
pub(crate) fn end_len(dialect: &Dialect) -> usize {
    2 - usize::from(dialect.lone_lf)
}

/// The formats of a robot's axes: X, Y, Z, C.
pub(crate) static ROBOT: [Format; 4] = [LENGTH, LENGTH, LENGTH, ANGLE];

/// The formats of a platform's axes: A, B.
pub(crate) static PLATFORM: [Format; 2] = [ANGLE, ANGLE];

static INTEGERS: [Format; 1] = [INTEGER];
