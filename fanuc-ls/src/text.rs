//! What every part of the grammar needs: white space, numbers, and an error that knows its place.

use alloc::format;
use alloc::string::String;

use nom::bytes::complete::{tag, take_while, take_while1};
use nom::error::{ErrorKind, ParseError};
use nom::{IResult, Parser};

use crate::error::Reason;

/// What is still to be read, and what was read.
pub(crate) type Read<'a, T> = IResult<&'a str, T, Fault<'a>>;

/// Where reading stopped, and why. Becomes a [`DecodeError`](crate::DecodeError) once the whole text is at hand.
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

/// The failure at `at`.
pub(crate) fn fail<T>(at: &str, reason: Reason) -> Read<'_, T> {
    Err(nom::Err::Failure(Fault { at, reason }))
}

/// What `parser` reads, or the failure at this place, for this reason.
pub(crate) fn or_fail<'a, T>(
    input: &'a str,
    reason: Reason,
    mut parser: impl Parser<&'a str, Output = T, Error = Fault<'a>>,
) -> Read<'a, T> {
    match parser.parse(input) {
        Err(nom::Err::Error(_)) => fail(input, reason),
        other => other,
    }
}

/// Spaces, tabs and line ends.
pub(crate) fn space(input: &str) -> &str {
    input.trim_start_matches([' ', '\t', '\r', '\n'])
}

/// Spaces, tabs, and the line end with `:` that continues an instruction.
pub(crate) fn joint(input: &str) -> &str {
    let mut rest = input.trim_start_matches([' ', '\t']);
    while let Some(next) = rest.trim_start_matches('\r').strip_prefix('\n') {
        let Some(next) = next.trim_start_matches([' ', '\t']).strip_prefix(':') else { break };
        rest = next.trim_start_matches([' ', '\t']);
    }
    rest
}

/// `word`, or the failure.
pub(crate) fn expect<'a>(input: &'a str, word: &'static str, reason: Reason) -> Read<'a, &'a str> {
    or_fail(input, reason, tag(word))
}

/// A word of letters, digits and `_`.
pub(crate) fn word(input: &str) -> Read<'_, &str> {
    take_while1(|c: char| c.is_alphanumeric() || c == '_').parse(input)
}

/// A whole number without a sign.
pub(crate) fn unsigned<N: core::str::FromStr>(input: &str) -> Read<'_, N> {
    nom::combinator::map_opt(nom::character::complete::digit1, |digits: &str| digits.parse().ok())
        .parse(input)
}

/// A decimal number; the zero before the point may be missing, the point as well.
pub(crate) fn decimal(input: &str) -> Read<'_, f64> {
    let unsigned = input.strip_prefix(['-', '+']).unwrap_or(input);
    let digits = |input| -> Read<'_, &str> { take_while(|c: char| c.is_ascii_digit()).parse(input) };
    let (mut rest, _) = digits(unsigned)?;
    if let Some(fraction) = rest.strip_prefix('.') {
        (rest, _) = digits(fraction)?;
    }
    let length = input.len().saturating_sub(rest.len());
    // A sign or a point without digits does not parse.
    match input.get(..length).and_then(|text| text.parse::<f64>().ok()).filter(|value| value.is_finite()) {
        Some(value) => Ok((rest, value)),
        None => Err(nom::Err::Error(Fault::from_error_kind(input, ErrorKind::Float))),
    }
}

/// What stands for a register or a position: letters and brackets, `R[1]`, `PR[GP1:3]`, `P[R[1]]`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reference<'a> {
    pub(crate) text: &'a str,
    pub(crate) letters: &'a str,
    pub(crate) inside: &'a str,
}

/// A reference, or the failure for this reason.
pub(crate) fn reference(input: &str, reason: Reason) -> Read<'_, Reference<'_>> {
    let (behind, letters) = or_fail(input, reason, take_while1(|c: char| c.is_ascii_alphabetic()))?;
    let (inner, _) = or_fail(behind, reason, tag("["))?;
    let mut depth = 0usize;
    for (at, c) in inner.char_indices() {
        match c {
            '[' => depth += 1,
            ']' if depth > 0 => depth -= 1,
            ']' => {
                let (inside, rest) = inner.split_at_checked(at).unwrap_or((inner, ""));
                let text = input.get(..letters.len() + at + 2).unwrap_or(input);
                return Ok((rest.strip_prefix(']').unwrap_or(rest), Reference { text, letters, inside }));
            }
            '\r' | '\n' => break,
            _ => {}
        }
    }
    fail(inner, Reason::Bracket)
}

/// The text of an instruction without the marks that continue it: one line for each line, trimmed.
pub(crate) fn join_lines(input: &str) -> String {
    let mut text = String::new();
    for (index, line) in input.trim_matches([' ', '\t', '\r', '\n']).split('\n').enumerate() {
        let line = line.trim_matches([' ', '\t', '\r']);
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

/// `value` with three decimals as controllers print it, or with as many as it has: without the zero before the point, but
/// zero is `0.000`.
pub(crate) fn fixed(value: f64) -> String {
    let mut text = format!("{value:.3}");
    if text.parse() != Ok(value) {
        text = format!("{value}");
    }
    if text == "0.000" { text } else { without_leading_zero(text) }
}

/// `value` with as many decimals as it has: `10`, `10.5`, `.5`.
pub(crate) fn shortest(value: f64) -> String {
    without_leading_zero(format!("{value}"))
}

/// `value` with three decimals, which is what controllers print.
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

/// Nothing that ends a line but `\n`, and no line before the last that would close the instruction.
pub(crate) fn is_plain(text: &str) -> bool {
    let mut lines = text.split('\n').rev();
    let control = |line: &str| line.contains(|c: char| c.is_control() && c != '\t');
    lines.next().is_some_and(|last| !control(last))
        && lines.all(|line| !control(line) && !line.trim_end().ends_with(';'))
}

/// A line of a block: deeper than the four columns of a line number, and not simply the next line of a program whose
/// numbers are all that deep. `number` is that of the last line that is not in a block.
pub(crate) fn is_nested(line: &str, number: usize, in_block: bool) -> bool {
    let body = line.trim_start_matches(' ');
    if line.len() - body.len() < 5 {
        return false;
    }
    let digits = body.len() - body.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    let own = body.get(..digits).and_then(|digits| digits.parse::<usize>().ok());
    number > 0 && (in_block || own != Some(number + 1)) && !body.starts_with(':')
}
