//! Fields of digits, eight characters at a time in one word whose lowest byte is the first character.

use crate::error::Expected;

/// A sign and digits, with or without a point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Format {
    /// The field with the value +0.
    zero: u64,
    /// The position of the sign in the word.
    sign_at: u32,
    /// The range of each character less that of `zero`: adding `limit` sets no bit of `excess`.
    limit: u64,
    excess: u64,
    /// The last four characters are worth `value % split`, those before them `value / split * scale`: a point among them
    /// is a digit 0.
    split: u32,
    scale: u32,
    /// The value of a minus, which is read as a digit 2.
    minus: u32,
    layout: &'static [Expected],
}

/// `Sxxx.yyy` in units of the last digit.
pub(crate) const LENGTH: Format = {
    use Expected::{Digit, Point, Sign};
    Format::new(*b"+000.000", 1000, 1, &[Sign, Digit, Digit, Digit, Point, Digit, Digit, Digit])
};

/// `Sxx.yyyy` in units of the last digit.
pub(crate) const ANGLE: Format = {
    use Expected::{Digit, Point, Sign};
    Format::new(*b"+00.0000", 10_000, 10, &[Sign, Digit, Digit, Point, Digit, Digit, Digit, Digit])
};

/// `Sxxxxx`: the first two bytes of the word are any bytes before the field.
pub(crate) const INTEGER: Format = {
    use Expected::{Digit, Sign};
    Format::new(*b"\0\0+00000", 10_000, 1, &[Sign, Digit, Digit, Digit, Digit, Digit])
};

const PLUS_TO_MINUS: u64 = (b'-' - b'+') as u64;

impl Format {
    const fn new(zero: [u8; 8], split: u32, scale: u32, layout: &'static [Expected]) -> Self {
        let (mut sign_at, mut limit, mut excess, mut at) = (0, 0, 0, 0);
        let mut rest = zero.as_slice();
        while let [first, after @ ..] = rest {
            let (most, bits) = match *first {
                b'+' => {
                    sign_at = at;
                    (0, !PLUS_TO_MINUS & 0xFF)
                }
                b'0' => (0x7F - 9, 0x80),
                b'.' => (0x7F, 0x80),
                _ => (0, 0),
            };
            limit |= most << at;
            excess |= bits << at;
            (rest, at) = (after, at + 8);
        }
        let minus = if sign_at == 0 { 2000 } else { 20 } * (split / scale);
        Self { zero: u64::from_le_bytes(zero), sign_at, limit, excess, split, scale, minus, layout }
    }

    /// Returns the value of a field, and 0 if all its characters fit; otherwise the value is meaningless.
    #[inline(always)]
    pub(crate) const fn value(self, field: u64) -> (i32, u64) {
        let (number, misfit) = self.number(field);
        let value = if number < self.minus { number } else { self.minus.wrapping_sub(number) };
        (value.cast_signed(), misfit)
    }

    /// Returns the number that a field's digits and its sign are, with a minus as a 2 among the digits; without a sign, the
    /// value of the field. The second number is as in [`value`](Self::value): 0 if all characters fit.
    #[inline(always)]
    pub(crate) const fn number(self, field: u64) -> (u32, u64) {
        // A character below that of `zero` borrows from the next one, and shows a high bit itself.
        let word = field.wrapping_sub(self.zero);
        let misfit = (word | word.wrapping_add(self.limit)) & self.excess;
        let digits = word & (u64::MAX << self.sign_at);
        // Neighbours are added up in pairs, three times: each lane of a product is a lane and 10, 100 or 1000 times
        // the previous one.
        let pairs = digits.wrapping_mul((10 << 8) + 1) >> 8 & 0x00FF_00FF_00FF_00FF;
        let fours = pairs.wrapping_mul((100 << 16) + 1) >> 16 & 0x0000_FFFF_0000_FFFF;
        let number = (fours.wrapping_mul((((self.split / self.scale) as u64) << 32) + 1) >> 32) as u32;
        (number, misfit)
    }

    /// Returns whether a field is the value +0.
    #[inline(always)]
    pub(crate) const fn is_zero(self, field: u64) -> bool {
        (field ^ self.zero) >> self.sign_at == 0
    }

    /// Returns the field of a value that fits.
    #[inline(always)]
    pub(crate) const fn text(self, value: i32) -> u64 {
        let magnitude = value.unsigned_abs();
        let word = four(magnitude / self.split * self.scale) + (four(magnitude % self.split) << 32);
        let sign = if value < 0 { PLUS_TO_MINUS << self.sign_at } else { 0 };
        self.zero + word + sign
    }

    /// Returns the characters that the format allows.
    pub(crate) const fn layout(self) -> &'static [Expected] {
        self.layout
    }
}

/// Returns the four digits of a number below 10000, one per byte, the first one lowest.
const fn four(number: u32) -> u64 {
    let pairs = ((number % 100) << 16) + number / 100;
    // 103 / 1024 is a tenth, near enough for all below 100.
    let tens = ((pairs * 103) >> 10) & 0x000F_000F;
    (((pairs - 10 * tens) << 8) + tens) as u64
}

impl Expected {
    /// Returns whether a field of digits allows this character here.
    pub(crate) fn allows(self, found: u8) -> bool {
        match self {
            Self::Sign => matches!(found, b'+' | b'-'),
            Self::Digit => found.is_ascii_digit(),
            Self::Point => found == b'.',
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::format;

    use super::*;

    fn all() -> [Format; 3] {
        [LENGTH, ANGLE, INTEGER]
    }

    /// By hand: a digit has room for 9, a point and the bytes in front of a field for nothing and for anything.
    #[test]
    fn limits_follow_from_the_zero() {
        let zeros = [(*b"+000.000", 1000, 1), (*b"+00.0000", 10_000, 10), (*b"\0\0+00000", 10_000, 1)];
        let limits = [
            (0, 0x7676_767F_7676_7600, 0x8080_8080_8080_80FD),
            (0, 0x7676_7676_7F76_7600, 0x8080_8080_8080_80FD),
            (16, 0x7676_7676_7600_0000, 0x8080_8080_80FD_0000),
        ];
        for ((zero, split, scale), expected) in zeros.into_iter().zip(limits) {
            let format = Format::new(zero, split, scale, &[]);
            assert_eq!((format.sign_at, format.limit, format.excess), expected, "{}", zero.escape_ascii());
            assert_eq!(format.zero.to_le_bytes(), zero);
        }
    }

    #[test]
    fn every_value_has_its_text() {
        for value in (-999_999..=999_999).step_by(37).chain([-999_999_i32, -1, 0, 1, 999_999]) {
            let sign = if value < 0 { '-' } else { '+' };
            let digits = format!("{:06}", value.unsigned_abs());
            let texts = [
                format!("{sign}{}.{}", &digits[..3], &digits[3..]),
                format!("{sign}{}.{}", &digits[..2], &digits[2..]),
                format!("\0\0{sign}{:05}", value.unsigned_abs()),
            ];
            for (format, text) in all().into_iter().zip(texts) {
                let Ok(field) = <[u8; 8]>::try_from(text.as_bytes()) else { continue };
                assert_eq!(format.text(value).to_le_bytes(), field, "{text}");
                assert_eq!(format.value(u64::from_le_bytes(field)), (value, 0), "{text}");
            }
        }
    }

    /// Each character of each field, with each byte in its place and beside another wrong one.
    #[test]
    fn whatever_does_not_fit_is_seen() {
        for format in all() {
            let zero = format.zero.to_le_bytes();
            let unused = 8 - format.layout().len();
            for (i, byte) in (0..8).flat_map(|i| (0..=255).map(move |byte| (i, byte))) {
                let mut field = zero;
                field[i] = byte;
                let fits = if i < unused { true } else { format.layout()[i - unused].allows(byte) };
                assert_eq!(format.value(u64::from_le_bytes(field)).1 == 0, fits, "{}", field.escape_ascii());
                for wrong in [0, b'*', b',', b'/', b':', 0xFF] {
                    field[7] = wrong;
                    assert_ne!(format.value(u64::from_le_bytes(field)).1, 0, "{}", field.escape_ascii());
                }
            }
        }
    }
}
