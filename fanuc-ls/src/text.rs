//! Common parts of the grammar: white space, numbers, and an error with its place.

use alloc::borrow::ToOwned;
use alloc::format;
use alloc::string::String;

use nom::bytes::complete::take_while1;
use nom::error::{ErrorKind, ParseError};
use nom::{IResult, Parser};

use crate::error::Reason;

/// The unread text, and the result.
pub(crate) type ParseResult<'a, T> = IResult<&'a str, T, Fault<'a>>;

/// The offset and the reason of a failure. Becomes a [`DecodeError`](crate::DecodeError) once the whole text is available.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Fault<'a> {
    pub(crate) at: &'a str,
    pub(crate) reason: Reason,
}

impl<'a> Fault<'a> {
    pub(crate) fn of(error: nom::Err<Self>) -> Self {
        match error {
            nom::Err::Error(fault) | nom::Err::Failure(fault) => fault,
            // The parsers are the complete ones: this is never made.
            nom::Err::Incomplete(_) => Fault { at: "", reason: Reason::End },
        }
    }
}

impl<'a> ParseError<&'a str> for Fault<'a> {
    // The combinators' own kinds never leave this crate: `or_fail` puts the reason in their place.
    fn from_error_kind(at: &'a str, _: ErrorKind) -> Self {
        Self { at, reason: Reason::Program }
    }

    fn append(_: &'a str, _: ErrorKind, other: Self) -> Self {
        other
    }
}

/// Returns the failure at `at`.
pub(crate) fn fail<T>(at: &str, reason: Reason) -> ParseResult<'_, T> {
    Err(nom::Err::Failure(Fault { at, reason }))
}

/// Returns the result of `parser`, or the failure at this place, with this reason.
pub(crate) fn or_fail<'a, T>(
    input: &'a str,
    reason: Reason,
    mut parser: impl Parser<&'a str, Output = T, Error = Fault<'a>>,
) -> ParseResult<'a, T> {
    match parser.parse(input) {
        Err(nom::Err::Error(_)) => fail(input, reason),
        other => other,
    }
}

/// Returns the text after spaces and tabs.
#[inline]
pub(crate) fn indent(input: &str) -> &str {
    let blanks = input.bytes().position(|byte| !matches!(byte, b' ' | b'\t')).unwrap_or(input.len());
    input.get(blanks..).unwrap_or("")
}

/// Returns the text after white space, which is seldom more than spaces and tabs.
#[inline]
pub(crate) fn after_blanks(line: &str) -> &str {
    let rest = indent(line);
    if matches!(rest.as_bytes(), [b'!'..=b'~', ..]) { rest } else { rest.trim_start() }
}

/// Returns a text without spaces, tabs and line ends before and after it.
#[inline]
pub(crate) fn trim(text: &str) -> &str {
    let is_blank = |byte: &u8| matches!(byte, b' ' | b'\t' | b'\r' | b'\n');
    let bytes = text.as_bytes();
    let start = bytes.iter().position(|byte| !is_blank(byte)).unwrap_or(bytes.len());
    let end = bytes.iter().rposition(|byte| !is_blank(byte)).map_or(start, |last| last + 1);
    text.get(start..end).unwrap_or("")
}

/// Spaces, tabs, and the line end with `:` that continues an instruction.
#[inline]
pub(crate) fn joint(input: &str) -> &str {
    let mut rest = indent(input);
    if !rest.starts_with(['\r', '\n']) {
        return rest;
    }
    while let Some(next) = rest.trim_start_matches('\r').strip_prefix('\n') {
        let Some(next) = indent(next).strip_prefix(':') else { break };
        rest = indent(next);
    }
    rest
}

/// Returns the text after `word`, or the failure.
#[inline]
pub(crate) fn expect<'a>(
    input: &'a str,
    word: &'static str,
    reason: Reason,
) -> Result<&'a str, nom::Err<Fault<'a>>> {
    input.strip_prefix(word).ok_or(nom::Err::Failure(Fault { at: input, reason }))
}

/// Returns whether a character is a letter: of ASCII, or any other character that is not white space, so that no table is
/// needed.
pub(crate) fn is_letter(c: char) -> bool {
    if c.is_ascii() { c.is_ascii_alphabetic() } else { !c.is_whitespace() }
}

pub(crate) fn is_letter_or_digit(c: char) -> bool {
    is_letter(c) || c.is_ascii_digit()
}

/// Reads a word of letters, digits and `_`.
pub(crate) fn word(input: &str) -> ParseResult<'_, &str> {
    take_while1(|c: char| is_letter_or_digit(c) || c == '_').parse(input)
}

/// Returns the number of digits at the beginning.
#[inline]
pub(crate) fn digits(input: &str) -> usize {
    input.bytes().position(|byte| !byte.is_ascii_digit()).unwrap_or(input.len())
}

/// Reads a whole number without a sign.
#[inline]
pub(crate) fn unsigned<N: core::str::FromStr>(input: &str) -> ParseResult<'_, N> {
    let number = input.split_at_checked(digits(input));
    match number.and_then(|(digits, rest)| Some((rest, digits.parse().ok()?))) {
        Some(read) => Ok(read),
        None => Err(nom::Err::Error(Fault::from_error_kind(input, ErrorKind::Digit))),
    }
}

/// Returns the number in a text that consists of digits alone.
pub(crate) fn plain_number<N: core::str::FromStr>(text: &str) -> Option<N> {
    // `parse` accepts a sign as the first character.
    if text.starts_with(|first: char| first.is_ascii_digit()) { text.parse().ok() } else { None }
}

/// Returns the number of a statement, with the same limit on every computer.
#[inline]
pub(crate) fn line_number(digits: &str) -> Option<usize> {
    plain_number::<u32>(digits)?.try_into().ok()
}

/// Reads a decimal number; the zero before the point may be missing, and the point too.
pub(crate) fn decimal(input: &str) -> ParseResult<'_, f64> {
    let number = decimal_prefix(input.as_bytes());
    match number.and_then(|(value, length)| Some((input.get(length..)?, value))) {
        Some(read) => Ok(read),
        None => Err(nom::Err::Error(Fault::from_error_kind(input, ErrorKind::Float))),
    }
}

/// Returns the decimal number at the beginning of a text, and its length.
#[inline(always)]
pub(crate) fn decimal_prefix(input: &[u8]) -> Option<(f64, usize)> {
    let (negative, sign) = match input.first() {
        Some(b'-') => (true, 1),
        Some(b'+') => (false, 1),
        _ => (false, 0),
    };
    match short_decimal(input.get(sign..)?) {
        Some((value, length)) => Some((if negative { -value } else { value }, sign + length)),
        None => long_decimal(input, negative, sign),
    }
}

/// Reads from one word a number with a point, without a sign, and shorter than eight bytes: nearly every number.
#[inline(always)]
fn short_decimal(input: &[u8]) -> Option<(f64, usize)> {
    let digits = u64::from_le_bytes(*input.first_chunk()?) ^ u64::from_le_bytes([b'0'; 8]);
    let others = above_nine(digits);
    let point = others.trailing_zeros().checked_sub(7)?;
    let end = (others & others.wrapping_sub(1)).trailing_zeros().checked_sub(7)?;
    if others == 0 || (digits >> point) & 0xFF != u64::from(b'.' ^ b'0') || end > 56 || end == 8 {
        return None;
    }
    // Without the point, and with zeros before it, to eight digits.
    let whole = (1 << point) - 1;
    let number = eight_digits((digits & whole | digits >> 8 & !whole) << (72 - end));
    let decimals = (end - point) as usize / 8 - 1;
    Some((number / POWERS.get(decimals)?, end as usize / 8))
}

/// Returns the number that [`push_fixed`] writes into ten columns, with three decimals and up to four characters before the
/// point.
#[inline(always)]
pub(crate) fn fixed_decimal(columns: &[u8; 10]) -> Option<f64> {
    let [b' ', b' ', word @ ..] = columns else { return None };
    let text = u64::from_le_bytes(*word);
    let digits = text ^ u64::from_le_bytes([b'0'; 8]);
    if word[4] != b'.' {
        return None;
    }
    let blanks = (text ^ u64::from_le_bytes([b' '; 8])).trailing_zeros() & !7;
    let negative = (text >> blanks) & 0xFF == u64::from(b'-');
    let whole = u64::MAX << (blanks + if negative { 8 } else { 0 });
    if above_nine(digits) != u64::from_le_bytes([0x80, 0x80, 0x80, 0x80, 0, 0, 0, 0]) & !whole | 0x80 << 32 {
        return None;
    }
    let digits = digits & whole;
    let value = eight_digits((digits << 8) & 0xFF_FFFF_FF00 | digits & 0xFF_FFFF << 40) / 1000.0;
    Some(if negative { -value } else { value })
}

/// Returns the top bit of each byte above 9; a point and a blank add nothing to the next byte.
#[inline(always)]
fn above_nine(digits: u64) -> u64 {
    (digits.wrapping_add(u64::from_le_bytes([0x7F - 9; 8])) | digits) & u64::from_le_bytes([0x80; 8])
}

/// Returns the number of eight digits, the first one in the lowest byte.
#[inline(always)]
fn eight_digits(digits: u64) -> f64 {
    let pairs = (digits.wrapping_mul(10 << 8 | 1) >> 8) & 0x00FF_00FF_00FF_00FF;
    let fours = (pairs.wrapping_mul(100 << 16 | 1) >> 16) & 0x0000_FFFF_0000_FFFF;
    let number = fours.wrapping_mul(10_000 << 32 | 1) >> 32;
    f64::from(number as u32)
}

#[inline(never)]
fn long_decimal(input: &[u8], negative: bool, sign: usize) -> Option<(f64, usize)> {
    let mut mantissa = 0u64;
    let mut run = |mut at: usize| {
        while let Some(digit @ b'0'..=b'9') = input.get(at) {
            mantissa = mantissa.wrapping_mul(10).wrapping_add((digit - b'0').into());
            at += 1;
        }
        at
    };
    let mut length = run(sign);
    let (mut digits, mut decimals) = (length - sign, 0);
    if input.get(length) == Some(&b'.') {
        let start = length + 1;
        length = run(start);
        decimals = length - start;
        digits += decimals;
    }
    // Up to fifteen digits and the power of ten are exact, and so is their quotient but for its one rounding.
    let value = match POWERS.get(decimals) {
        Some(power) if (1..16).contains(&digits) => {
            #[expect(clippy::cast_precision_loss, reason = "it has fifteen digits at most")]
            let value = mantissa as f64 / power;
            if negative { -value } else { value }
        }
        // A sign or a point without digits does not parse.
        _ => core::str::from_utf8(input.get(..length)?).ok()?.parse().ok()?,
    };
    value.is_finite().then_some((value, length))
}

/// The powers of ten that [`decimal`] divides by.
const POWERS: [f64; 16] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// The text of a register or a position: letters and brackets, `R[1]`, `PR[GP1:3]`, `P[R[1]]`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reference<'a> {
    pub(crate) text: &'a str,
    pub(crate) letters: &'a str,
    pub(crate) inside: &'a str,
}

/// Reads a reference, or fails for this reason.
pub(crate) fn reference(input: &str, reason: Reason) -> ParseResult<'_, Reference<'_>> {
    let (behind, letters) = or_fail(input, reason, take_while1(|c: char| c.is_ascii_alphabetic()))?;
    let inner = expect(behind, "[", reason)?;
    let mut depth = 0usize;
    for (at, byte) in inner.bytes().enumerate() {
        match byte {
            b'[' => depth += 1,
            b']' if depth > 0 => depth -= 1,
            b']' => {
                let (inside, rest) = inner.split_at_checked(at).unwrap_or((inner, ""));
                let text = input.get(..letters.len() + at + 2).unwrap_or(input);
                return Ok((rest.strip_prefix(']').unwrap_or(rest), Reference { text, letters, inside }));
            }
            b'\r' | b'\n' => break,
            _ => {}
        }
    }
    fail(inner, Reason::Bracket)
}

/// Joins the text of an instruction, without the marks that continue it: one trimmed line for each line.
pub(crate) fn join_lines(input: &str) -> String {
    let input = trim(input);
    if !input.contains('\n') {
        return input.to_owned();
    }
    let mut text = String::with_capacity(input.len());
    for (index, line) in input.split('\n').enumerate() {
        let line = trim(line);
        if index > 0 {
            text.push('\n');
        }
        text.push_str(if index > 0 {
            line.strip_prefix(':').unwrap_or(line).trim_start_matches([' ', '\t'])
        } else {
            line
        });
    }
    text
}

/// Writes `value` right-aligned in ten columns: with three decimals as controllers print it, or with as many as it has; without
/// the zero before the point, but zero is `0.000`.
pub(crate) fn push_fixed(out: &mut String, value: f64) {
    let thousandths = value.abs() * 1000.0;
    if value != 0.0 && thousandths < 1e15 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it is below 1e15")]
        let thousandths = (thousandths + 0.5) as u64;
        #[expect(clippy::cast_precision_loss, reason = "it is below 1e15")]
        let same = thousandths as f64 / 1000.0 == value.abs();
        if same {
            return push_thousandths(out, value < 0.0, thousandths);
        }
    }
    let mut text = format!("{value:.3}");
    if text.parse() != Ok(value) {
        text = format!("{value}");
    }
    if text != "0.000" {
        text = without_leading_zero(text);
    }
    out.extend(core::iter::repeat_n(' ', 10usize.saturating_sub(text.len())));
    out.push_str(&text);
}

/// Appends thousandths: `-1234` is `    -1.234`.
fn push_thousandths(out: &mut String, negative: bool, thousandths: u64) {
    let (whole, fraction) = (thousandths / 1000, thousandths % 1000);
    let digits = whole.checked_ilog10().map_or(0, |digits| digits as usize + 1);
    let before = if negative { "     -" } else { "      " };
    out.push_str(before.get(digits.min(5 + usize::from(!negative))..).unwrap_or(""));
    if whole > 0 {
        push_digits(out, whole);
    }
    out.push_str(group(fraction, 0));
}

/// Writes `value` with as many decimals as it has: `10`, `10.5`, `.5`.
pub(crate) fn push_shortest(out: &mut String, value: f64) {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it saturates")]
    let whole = value as u32;
    if f64::from(whole) == value && value.is_sign_positive() {
        push_number(out, whole, 0);
    } else {
        out.push_str(&without_leading_zero(format!("{value}")));
    }
}

/// Writes a number right-aligned in this many of ten columns, or in as many as it needs.
pub(crate) fn push_number(out: &mut String, number: u32, columns: usize) {
    let digits = number.checked_ilog10().map_or(1, |digits| digits as usize + 1);
    out.push_str("          ".get(digits..columns).unwrap_or(""));
    push_digits(out, number.into());
}

fn push_digits(out: &mut String, number: u64) {
    if number < 1000 {
        let zeros = usize::from(number < 100) + usize::from(number < 10);
        return out.push_str(group(number, 1 + zeros));
    }
    push_digits(out, number / 1000);
    out.push_str(group(number % 1000, 1));
}

/// Returns a number below 1000 as three digits after a point, without this many of its characters.
fn group(number: u64, without: usize) -> &'static str {
    #[expect(clippy::cast_possible_truncation, reason = "it is below 1000")]
    let at = number as usize * 4;
    GROUPS.get(at + without..at + 4).unwrap_or("")
}

/// `.000.001.002`, to `.999`: digits are copied, and not made.
const GROUPS: &str = {
    const DIGITS: [u8; 4000] = {
        let mut digits = [b'0'; 4000];
        let mut rest: &mut [u8] = &mut digits;
        let mut number = *b"000";
        while let [point, hundreds, tens, ones, others @ ..] = rest {
            *point = b'.';
            [*hundreds, *tens, *ones] = number;
            rest = others;
            number = match number {
                [hundreds, b'9', b'9'] => [hundreds + 1, b'0', b'0'],
                [hundreds, tens, b'9'] => [hundreds, tens + 1, b'0'],
                [hundreds, tens, ones] => [hundreds, tens, ones + 1],
            };
        }
        digits
    };
    match core::str::from_utf8(&DIGITS) {
        Ok(digits) => digits,
        Err(_) => "",
    }
};

/// Returns `value` rounded to three decimals, as controllers print it.
pub(crate) fn rounded(value: f64) -> f64 {
    format!("{value:.3}").parse().unwrap_or(value)
}

fn without_leading_zero(mut text: String) -> String {
    if text.starts_with("0.") {
        text.remove(0);
    } else if text.starts_with("-0.") {
        text.remove(1);
    }
    text
}

/// Returns whether a text has no line end except `\n`, and no line before the last that would close the instruction.
pub(crate) fn is_plain(text: &str) -> bool {
    let mut lines = text.split('\n').rev();
    let control = |line: &str| {
        let ascii = line.bytes().all(|byte| matches!(byte, b' '..=b'~' | b'\t'));
        !ascii && line.contains(|c: char| c.is_control() && c != '\t')
    };
    lines.next().is_some_and(|last| !control(last))
        && lines.all(|line| !control(line) && !line.trim_end().ends_with(';'))
}

/// Returns whether a line is in a block: indented by more than the four columns of a line number, and not simply the next
/// line of a program whose numbers are all indented that far. `number` is that of the last line outside blocks.
pub(crate) fn is_nested(line: &str, number: usize, in_block: bool) -> bool {
    let spaces = line.bytes().take_while(|byte| *byte == b' ').count();
    if spaces < 5 {
        return false;
    }
    let body = line.get(spaces..).unwrap_or("");
    let digits = digits(body);
    let own = body.get(..digits).and_then(line_number);
    // A line of a block may continue in one that begins with the colon.
    number > 0 && (in_block || own != Some(number.saturating_add(1)) && !body.starts_with(':'))
}
