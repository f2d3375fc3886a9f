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

/// A number below 100 000 000 as it is written, the first digit lowest, and how many they are. `None`: it has more.
#[inline(always)]
pub(crate) fn text_of(number: u32) -> Option<(u64, usize)> {
    let one = |number: u32| u64::from(number) + u64::from(b'0');
    let two = |number: u32| PAIRS.get(number as usize).map_or(0, |digits| u64::from(*digits));
    let four = |number: u32| two(number / 100) | two(number % 100) << 16;
    Some(match number {
        0..10_000 => match number {
            0..10 => (one(number), 1),
            10..100 => (two(number), 2),
            100..1000 => (one(number / 100) | two(number % 100) << 8, 3),
            _ => (four(number), 4),
        },
        10_000..100_000 => (one(number / 10_000) | four(number % 10_000) << 8, 5),
        100_000..1_000_000 => (two(number / 10_000) | four(number % 10_000) << 16, 6),
        1_000_000..10_000_000 => {
            let (first, last) = (number / 10_000, number % 10_000);
            (one(first / 100) | two(first % 100) << 8 | four(last) << 24, 7)
        }
        10_000_000..100_000_000 => (four(number / 10_000) | four(number % 10_000) << 32, 8),
        _ => return None,
    })
}

/// The two digits of each number below 100, the first one lower.
const PAIRS: [u16; 100] = {
    let mut table = [0; 100];
    let mut rest: &mut [u16] = &mut table;
    let (mut tens, mut ones) = (b'0', b'0');
    while let [first, others @ ..] = rest {
        *first = u16::from_le_bytes([tens, ones]);
        rest = others;
        (tens, ones) = if ones == b'9' { (tens + 1, b'0') } else { (tens, ones + 1) };
    }
    table
};

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
    fn a_text_is_the_number() {
        let every = (0..100_000_000).step_by(997).chain(0..20_000);
        let ends = [1, 10, 100, 1000, 10_000, 100_000, 1_000_000, 10_000_000].map(|end| [end * 10 - 1, end]);
        for number in every.chain(ends.into_iter().flatten()) {
            let (text, length) = text_of(number).unwrap();
            assert_eq!(text.to_le_bytes()[..length], *number.to_string().as_bytes());
            assert_eq!(text.to_le_bytes()[length..], [0; 8][length..]);
        }
        assert_eq!([text_of(100_000_000), text_of(u32::MAX)], [None, None]);
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
