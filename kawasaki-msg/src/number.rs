//! Decimal numbers: text to number and back. A number with decimals is a count of the last one.

use core::fmt;

/// A number with a fixed count of decimals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Decimal {
    /// The number, in units of the last decimal.
    pub units: i32,
    /// The number of decimals: 0 to 9.
    pub places: u8,
}

impl Decimal {
    /// The most decimals that a number can have.
    pub const MAX_PLACES: u8 = 9;

    /// Returns the nearest number with this many decimals; halves are rounded away from zero. `None` for NaN, infinities,
    /// numbers beyond an `i32` of units, and more than 9 places.
    ///
    /// ```
    /// use kawasaki_msg::Decimal;
    /// let degrees = Decimal::nearest(-12.3456, 3);
    /// assert_eq!(degrees, Some(Decimal { units: -12_346, places: 3 }));
    /// assert_eq!(Decimal::nearest(0.0 / 0.0, 3), None);
    /// ```
    pub fn nearest(value: f64, places: u8) -> Option<Self> {
        if places > Self::MAX_PLACES {
            return None;
        }
        let scaled = value * f64::from(10u32.pow(u32::from(places)));
        let units = scaled + 0.5_f64.copysign(scaled);
        let fits = units > f64::from(i32::MIN) - 1.0 && units < f64::from(i32::MAX) + 1.0;
        #[expect(clippy::cast_possible_truncation, reason = "it fits, without what is after the point")]
        fits.then_some(Self { units: units as i32, places })
    }
}

impl fmt::Display for Decimal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let places = usize::from(self.places.min(Self::MAX_PLACES));
        let one = 10u32.pow(u32::from(self.places.min(Self::MAX_PLACES)));
        let units = self.units.unsigned_abs();
        let sign = if self.units < 0 { "-" } else { "" };
        match places {
            0 => write!(f, "{}", self.units),
            _ => write!(f, "{sign}{}.{:0places$}", units / one, units % one),
        }
    }
}

#[cfg(feature = "serde")]
impl serde::Serialize for Decimal {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.places == 0 { serializer.serialize_i32(self.units) } else { serializer.collect_str(self) }
    }
}

/// The reason that a text is not a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fault {
    /// There is no text.
    Missing,
    /// The text is not a number, or does not fit.
    NotANumber,
    /// The number would be rounded.
    TooPrecise,
}

/// Returns the number that a text begins with, and the rest, if it is digits alone: at most nine, with none or all of the
/// decimals.
#[inline(always)]
pub(crate) fn plain(text: &[u8], places: u8) -> Option<(i32, &[u8])> {
    let (negative, text) = text.strip_prefix(b"-").map_or((false, text), |rest| (true, rest));
    let (mut units, mut rest) = digits(text, 0);
    let mut length = text.len() - rest.len();
    if places > 0 {
        let [b'.', decimals @ ..] = rest else { return None };
        (units, rest) = digits(decimals, units);
        if decimals.len() - rest.len() != usize::from(places) {
            return None;
        }
        length += usize::from(places);
    }
    let number = if negative { 0i32.wrapping_sub_unsigned(units) } else { 0i32.wrapping_add_unsigned(units) };
    (1..=9).contains(&length).then_some((number, rest))
}

/// Appends the digits that a text begins with to a number; returns it with the rest. The number wraps: the caller counts the
/// digits.
#[inline(always)]
fn digits(mut text: &[u8], mut number: u32) -> (u32, &[u8]) {
    while let [byte, rest @ ..] = text
        && let digit @ 0..=9 = byte.wrapping_sub(b'0')
    {
        number = number.wrapping_mul(10).wrapping_add(u32::from(digit));
        text = rest;
    }
    (number, text)
}

/// Parses a number of up to this many decimals in any form; the blanks around it are ignored.
///
/// No sign but `-`: AS's `VAL` knows more, but nothing in the source sends more.
pub(crate) fn parse(text: &[u8], places: u8) -> Result<i32, Fault> {
    let text = text.trim_ascii();
    let (negative, text) = text.strip_prefix(b"-").map_or((false, text), |rest| (true, rest));
    let point = text.iter().position(|byte| places > 0 && *byte == b'.');
    let (whole, decimals) = text.split_at(point.unwrap_or(text.len()));
    let decimals = decimals.get(1..).unwrap_or_default();
    let (decimals, lost) = decimals.split_at(decimals.len().min(places.into()));
    let digits = || whole.iter().chain(decimals);
    if digits().next().is_none() || !digits().chain(lost).all(u8::is_ascii_digit) {
        return Err(Fault::NotANumber);
    }
    if lost.iter().any(|digit| *digit != b'0') {
        return Err(Fault::TooPrecise);
    }
    // Below zero, where there is one number more.
    let zeros = core::iter::repeat_n(&b'0', usize::from(places) - decimals.len());
    let units = digits()
        .chain(zeros)
        .try_fold(0i32, |units, digit| units.checked_mul(10)?.checked_sub(i32::from(digit - b'0')));
    units.and_then(|units| if negative { Some(units) } else { units.checked_neg() }).ok_or(Fault::NotANumber)
}

/// Returns the number of bytes of a number.
#[inline]
pub(crate) fn len(number: i32, places: u8) -> usize {
    let (sign, number) = (usize::from(number < 0), number.unsigned_abs());
    let digits = number.checked_ilog10().unwrap_or(0) as usize + 1;
    let digits = if places == 0 { digits } else { digits.max(usize::from(places) + 1) + 1 };
    sign + digits
}

/// Writes a number into a slice of its length.
#[inline]
pub(crate) fn write(number: i32, places: u8, place: &mut [u8]) {
    let (mut rest, mut whole) = (number.unsigned_abs(), place);
    if places > 0 {
        let (before, decimals) = whole.split_at_mut(whole.len().saturating_sub(usize::from(places)));
        rest = fill(rest, decimals);
        let Some((point, before)) = before.split_last_mut() else { return };
        *point = b'.';
        whole = before;
    }
    fill(rest, whole);
    if number < 0
        && let Some(sign) = whole.first_mut()
    {
        // The zero before the first digit.
        *sign = b'-';
    }
}

/// Fills a slice with the last digits of a number, and returns the digits before them.
#[inline]
fn fill(mut number: u32, place: &mut [u8]) -> u32 {
    for byte in place.iter_mut().rev() {
        // A digit is below 10.
        *byte = b'0' + u8::try_from(number % 10).unwrap_or(0);
        number /= 10;
    }
    number
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
        let text = |number, places| {
            let mut place = [0; 16];
            let length = len(number, places);
            write(number, places, &mut place[..length]);
            place[..length].to_vec()
        };
        for number in every.chain(ends).chain([i32::MAX, i32::MIN]).flat_map(|n| [n, n.wrapping_neg()]) {
            assert_eq!(text(number, 0), number.to_string().as_bytes());
        }
        for (number, places, expected) in
            [(0, 1, "0.0"), (5, 3, "0.005"), (-1500, 3, "-1.500"), (i32::MIN, 9, "-2.147483648")]
        {
            assert_eq!(text(number, places), expected.as_bytes());
        }
    }
}
