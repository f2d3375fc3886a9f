//! Decimal numbers: text to number and back. A number with decimals is a count of the last one.

/// Why a text is no number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fault {
    /// It is anything else, or does not fit.
    NotANumber,
    /// It would have to be rounded.
    TooPrecise,
}

/// A number of up to this many decimals, with the blanks around it left out.
///
/// No sign but `-`: AS's `VAL` knows more, but nothing in the source sends more.
pub(crate) fn parse(text: &[u8], places: u8) -> Result<i32, Fault> {
    match read(text, places) {
        (number, []) => number,
        _ => Err(Fault::NotANumber),
    }
}

/// The number that a text begins with, with the blanks around it, and what is after it.
#[inline(always)] // most are whole: the decimals are no code there
pub(crate) fn read(text: &[u8], places: u8) -> (Result<i32, Fault>, &[u8]) {
    let text = text.trim_ascii_start();
    let (negative, text) = text.strip_prefix(b"-").map_or((false, text), |rest| (true, rest));
    let (mut units, mut rest) = append(0, text);
    let (mut digits, mut lost) = (text.len() - rest.len(), 0);
    if places > 0 {
        let mut kept = 0;
        if let [b'.', decimals @ ..] = rest {
            let (place, others) = decimals.split_at(decimals.len().min(usize::from(places)));
            let after;
            (units, after) = append(units, place);
            kept = place.len() - after.len();
            rest = decimals.get(kept..).unwrap_or_default();
            if after.is_empty() {
                (lost, rest) = append(0, others);
            }
            digits += kept;
        }
        units = (kept..usize::from(places)).fold(units, |units, _| append(units, b"0").0);
    }
    let number = if negative { 0i32.checked_sub_unsigned(units) } else { i32::try_from(units).ok() };
    let number = match number {
        _ if digits == 0 => Err(Fault::NotANumber),
        _ if lost != 0 => Err(Fault::TooPrecise),
        number => number.ok_or(Fault::NotANumber),
    };
    (number, rest.trim_ascii_start())
}

/// A number and more digits of it, and what is after them; [`u32::MAX`] stands for all that is greater.
#[inline(always)] // where there is one digit, or none
fn append(mut number: u32, text: &[u8]) -> (u32, &[u8]) {
    let mut length = 0;
    while let Some(byte) = text.get(length)
        && let digit @ 0..=9 = byte.wrapping_sub(b'0')
    {
        number = if number < u32::MAX / 10 { 10 * number + u32::from(digit) } else { u32::MAX };
        length += 1;
    }
    (number, text.get(length..).unwrap_or_default())
}

/// How many bytes a number is.
#[inline]
pub(crate) fn len(number: i32, places: u8) -> usize {
    let (sign, number) = (usize::from(number < 0), number.unsigned_abs());
    let digits = number.checked_ilog10().unwrap_or(0) as usize + 1;
    let digits = if places == 0 { digits } else { digits.max(usize::from(places) + 1) + 1 };
    sign + digits
}

/// Writes a number into a place of its length.
#[inline]
pub(crate) fn write(number: i32, places: u8, place: &mut [u8]) {
    let (mut rest, mut whole) = (number.unsigned_abs(), place);
    if places > 0 {
        let (before, decimals) = whole.split_at_mut(whole.len().saturating_sub(usize::from(places)));
        rest = digits(rest, decimals);
        let Some((point, before)) = before.split_last_mut() else { return };
        *point = b'.';
        whole = before;
    }
    digits(rest, whole);
    if number < 0
        && let Some(sign) = whole.first_mut()
    {
        // The zero before the first digit.
        *sign = b'-';
    }
}

/// Fills a place with the last digits of a number, and gives those before them.
#[inline]
fn digits(mut number: u32, place: &mut [u8]) -> u32 {
    for byte in place.iter_mut().rev() {
        // A digit is below 10.
        *byte = b'0' + u8::try_from(number % 10).unwrap_or(0);
        number /= 10;
    }
    number
}

/// The text of a whole number.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Text {
    bytes: [u8; "-2147483648".len()],
    length: usize,
}

impl Text {
    pub(crate) fn new(number: i32) -> Self {
        let mut text = Self { bytes: [0; _], length: len(number, 0) };
        if let Some(place) = text.bytes.get_mut(..text.length) {
            write(number, 0, place);
        }
        text
    }

    pub(crate) fn as_bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }
}

impl IntoIterator for Text {
    type Item = u8;
    type IntoIter = core::iter::Take<core::array::IntoIter<u8, { "-2147483648".len() }>>;

    fn into_iter(self) -> Self::IntoIter {
        self.bytes.into_iter().take(self.length)
    }
}

#[cfg(test)]
mod tests {
    use std::string::ToString;

    use super::*;

    #[test]
    fn blanks_are_left_out_and_nothing_else() {
        assert_eq!(parse(b" 50 ", 0), Ok(50));
        assert_eq!(parse(b"-0050", 0), Ok(-50));
        assert_eq!(parse(b"00000000000000002147483647", 0), Ok(i32::MAX));
        assert_eq!(parse(b"-2147483648", 0), Ok(i32::MIN));
        for wrong in [
            "",
            " ",
            "-",
            "+5",
            "5 0",
            "5.0",
            "1e3",
            "- 5",
            "2147483648",
            "-2147483649",
            "4294967297",
            "42949672950",
        ] {
            assert_eq!(parse(wrong.as_bytes(), 0), Err(Fault::NotANumber), "{wrong:?}");
        }
    }

    #[test]
    fn decimals_are_read_in_every_form_and_none_is_rounded() {
        for (text, places, units) in [
            ("1.5", 3, 1500),
            ("1.500000", 3, 1500),
            ("-.5", 1, -5),
            ("2.", 2, 200),
            ("2", 9, 2_000_000_000),
            (" -2.147483648", 9, i32::MIN),
        ] {
            assert_eq!(parse(text.as_bytes(), places), Ok(units), "{text:?}");
        }
        for (text, places, fault) in [
            ("1.5001", 3, Fault::TooPrecise),
            ("9999999999.0001", 3, Fault::TooPrecise),
            ("1.500x", 2, Fault::NotANumber),
            ("1.5.0", 1, Fault::NotANumber),
            (".", 1, Fault::NotANumber),
            ("3", 9, Fault::NotANumber),
            ("2.147483648", 9, Fault::NotANumber),
        ] {
            assert_eq!(parse(text.as_bytes(), places), Err(fault), "{text:?}");
        }
    }

    #[test]
    fn a_text_is_the_number() {
        let every = (0..100_000_000).step_by(99_991).chain(0..20_000);
        let ends = (1..10).map(|digits| 10i32.pow(digits)).flat_map(|end| [end - 1, end]);
        for number in every.chain(ends).chain([i32::MAX, i32::MIN]).flat_map(|n| [n, n.wrapping_neg()]) {
            assert_eq!(Text::new(number).as_bytes(), number.to_string().as_bytes());
        }
        for (number, places, text) in
            [(0, 1, "0.0"), (5, 3, "0.005"), (-1500, 3, "-1.500"), (i32::MIN, 9, "-2.147483648")]
        {
            let mut place = [0; 16];
            let length = len(number, places);
            write(number, places, &mut place[..length]);
            assert_eq!(&place[..length], text.as_bytes());
        }
    }
}
