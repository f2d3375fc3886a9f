//! Whole decimal numbers: text to number and back.

/// A number with the blanks around it left out; `None` when it is anything else or does not fit.
///
/// No sign but `-`: AS's `VAL` knows more, but nothing in the source sends more.
pub(crate) fn parse(text: &[u8]) -> Option<i32> {
    let text = text.trim_ascii();
    let (negative, digits) = match text.split_first() {
        Some((b'-', rest)) => (true, rest),
        _ => (false, text),
    };
    if digits.is_empty() {
        return None;
    }
    digits.iter().try_fold(0i32, |value, byte| {
        let digit = i32::from(byte.wrapping_sub(b'0'));
        if digit > 9 {
            return None;
        }
        let value = value.checked_mul(10)?;
        if negative { value.checked_sub(digit) } else { value.checked_add(digit) }
    })
}

/// How many bytes a number is.
pub(crate) fn len(number: i32) -> usize {
    let digits = number.unsigned_abs().checked_ilog10().unwrap_or(0);
    digits as usize + 1 + usize::from(number < 0)
}

/// Eight digits of a number below 100 000 000, a byte each, the first one lowest, zeros before the number's own. `None`: it has more.
#[inline(always)]
pub(crate) fn eight_digits(number: u32) -> Option<u64> {
    let fours = match number {
        0..100_000_000 => u64::from(number / 10_000) | u64::from(number % 10_000) << 32,
        _ => return None,
    };
    // Fours are parted into pairs, and these into digits; each product is a division by 100, or by 10.
    let hundreds = ((fours * 5243) >> 19) & 0x0000_007F_0000_007F;
    let pairs = hundreds | (fours - 100 * hundreds) << 16;
    let tens = ((pairs * 103) >> 10) & 0x000F_000F_000F_000F;
    Some(tens | (pairs - 10 * tens) << 8)
}

/// The decimal digits of a number, first to last.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Digits {
    /// Filled from the back.
    text: [u8; 11],
    start: usize,
}

impl Digits {
    pub(crate) fn new(number: i32) -> Self {
        let mut digits = Self::unsigned(number.unsigned_abs());
        if number < 0 {
            digits.push_front(b'-');
        }
        digits
    }

    pub(crate) fn unsigned(mut rest: u32) -> Self {
        let mut digits = Self { text: [0; 11], start: 11 };
        loop {
            // A digit is below 10.
            digits.push_front(b'0' + u8::try_from(rest % 10).unwrap_or(0));
            rest /= 10;
            if rest == 0 {
                break;
            }
        }
        digits
    }

    pub(crate) fn as_bytes(&self) -> &[u8] {
        self.text.get(self.start..).unwrap_or_default()
    }

    fn push_front(&mut self, byte: u8) {
        self.start = self.start.saturating_sub(1);
        if let Some(place) = self.text.get_mut(self.start) {
            *place = byte;
        }
    }
}

impl Iterator for Digits {
    type Item = u8;

    fn next(&mut self) -> Option<u8> {
        let byte = self.text.get(self.start).copied();
        self.start += usize::from(byte.is_some());
        byte
    }
}

#[cfg(test)]
mod tests {
    use std::string::ToString;
    use std::vec::Vec;

    use super::*;

    #[test]
    fn blanks_are_left_out_and_nothing_else() {
        assert_eq!(parse(b" 50 "), Some(50));
        assert_eq!(parse(b"-0050"), Some(-50));
        assert_eq!(parse(b"2147483647"), Some(i32::MAX));
        assert_eq!(parse(b"-2147483648"), Some(i32::MIN));
        for wrong in
            ["", " ", "-", "+5", "5 0", "5.0", "1e3", "- 5", "2147483648", "-2147483649", "4294967297"]
        {
            assert_eq!(parse(wrong.as_bytes()), None, "{wrong:?}");
        }
    }

    #[test]
    fn eight_digits_are_the_number() {
        let every = (0..100_000_000).step_by(997).chain(0..20_000).chain([99_999_999]);
        for number in every {
            let digits = eight_digits(number).unwrap().to_le_bytes().map(|digit| digit + b'0');
            assert_eq!(digits.as_slice(), std::format!("{number:08}").as_bytes());
        }
        assert_eq!([eight_digits(100_000_000), eight_digits(u32::MAX)], [None, None]);
    }

    #[test]
    fn digits_are_the_number() {
        for number in [0, 7, -7, 10, 99999, i32::MAX, i32::MIN] {
            assert_eq!(Digits::new(number).as_bytes(), number.to_string().as_bytes());
            assert_eq!(len(number), number.to_string().len());
            assert_eq!(Digits::new(number).collect::<Vec<_>>(), number.to_string().into_bytes());
        }
    }
}
