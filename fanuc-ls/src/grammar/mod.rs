//! The grammar of statements: the text between a line's number and its `;` for instructions other than motions, and the options
//! after a motion. Text that does not fit is a [`Mistake`] at its place.

mod expression;
mod instruction;
mod operation;
mod options;
mod outside;
mod table;

use nom::error::{ErrorKind, ParseError};
use nom::{IResult, Parser};

use crate::mistake::{Expected, Mistake};
use crate::operation::Operation;
use crate::text::decimal_prefix;

pub(crate) use expression::item;
pub(crate) use instruction::{in_capitals, operation};
pub(crate) use options::{OPTIONS, option, options};
pub(crate) use table::{Context, Form, ROWS};

/// The unread text, and the result.
pub(crate) type Parsed<'a, T> = IResult<&'a str, T, LocatedMistake<'a>>;

/// A mistake, and its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct LocatedMistake<'a> {
    pub(crate) at: &'a str,
    pub(crate) mistake: Mistake,
}

impl<'a> LocatedMistake<'a> {
    pub(crate) fn of(error: nom::Err<Self>) -> Self {
        match error {
            nom::Err::Error(trouble) | nom::Err::Failure(trouble) => trouble,
            // The parsers are the complete ones: this is never made.
            nom::Err::Incomplete(_) => LocatedMistake { at: "", mistake: Mistake::Unknown },
        }
    }
}

impl<'a> ParseError<&'a str> for LocatedMistake<'a> {
    // The combinators' own kinds are replaced by `or_fail`, or try the next alternative.
    fn from_error_kind(at: &'a str, _: ErrorKind) -> Self {
        Self { at, mistake: Mistake::Unknown }
    }

    fn append(_: &'a str, _: ErrorKind, other: Self) -> Self {
        other
    }
}

/// Reads an instruction that is part of another, or of an option of a motion. The table names the parsers of its rows, some
/// of which read such an instruction by the table again: they do so here.
fn simple(input: &str) -> Parsed<'_, Operation> {
    instruction::instruction(input, Context::Anywhere)
}

/// Returns an error after which another alternative may fit.
fn other<T>(at: &str) -> Parsed<'_, T> {
    Err(nom::Err::Error(LocatedMistake { at, mistake: Mistake::Unknown }))
}

/// Fails because no alternative fits: reports this mistake here.
pub(crate) fn fail<T>(at: &str, mistake: Mistake) -> Parsed<'_, T> {
    Err(nom::Err::Failure(LocatedMistake { at: blank(at), mistake }))
}

/// Returns the result of `parser`, or the failure at this place.
pub(crate) fn or_fail<'a, T>(
    input: &'a str,
    expected: Expected,
    mut parser: impl Parser<&'a str, Output = T, Error = LocatedMistake<'a>>,
) -> Parsed<'a, T> {
    match parser.parse(input) {
        Err(nom::Err::Error(_)) => fail(input, Mistake::Expected { what: expected }),
        read => read,
    }
}

/// Returns the text after blanks, and after line ends with the `:` that continues an instruction.
pub(crate) fn blank(input: &str) -> &str {
    let mut rest = input.trim_start_matches([' ', '\t']);
    while rest.starts_with(['\r', '\n']) {
        rest = rest.trim_start();
        rest = rest.strip_prefix(':').unwrap_or(rest).trim_start_matches([' ', '\t']);
    }
    rest
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Reads a sign after blanks.
pub(crate) fn sign<'a>(sign: &'static str) -> impl Parser<&'a str, Output = (), Error = LocatedMistake<'a>> {
    move |input: &'a str| match blank(input).strip_prefix(sign) {
        Some(rest) => Ok((rest, ())),
        None => other(input),
    }
}

/// Reads words after blanks, in upper or lower case, with any blanks between them. The last one must be a whole word of the
/// text.
pub(crate) fn keyword<'a>(
    words: &'static str,
) -> impl Parser<&'a str, Output = (), Error = LocatedMistake<'a>> {
    move |input: &'a str| {
        let mut rest = input;
        for word in words.split(' ') {
            rest = blank(rest);
            match rest.split_at_checked(word.len()) {
                Some((found, after)) if found.eq_ignore_ascii_case(word) => rest = after,
                _ => return other(input),
            }
        }
        if words.ends_with(is_word) && rest.starts_with(is_word) { other(input) } else { Ok((rest, ())) }
    }
}

/// Returns the text after `parser`'s match, if it matches here.
pub(crate) fn next<'a>(
    input: &'a str,
    mut parser: impl Parser<&'a str, Output = (), Error = LocatedMistake<'a>>,
) -> Option<&'a str> {
    parser.parse(input).ok().map(|(rest, ())| rest)
}

/// Reads a number after blanks; small ones have an exponent: `1.5e-06`.
fn number(input: &str) -> Parsed<'_, f64> {
    let text = blank(input);
    let Some((value, length)) = decimal_prefix(text.as_bytes()) else { return other(input) };
    let rest = text.get(length..).unwrap_or("");
    let with_exponent = || {
        let exponent = rest.strip_prefix(['e', 'E'])?;
        let digits = exponent.strip_prefix(['+', '-']).unwrap_or(exponent);
        let count = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
        let after = digits.get(count..)?;
        Some((after, text.get(..text.len() - after.len())?.parse().ok()?))
    };
    Ok(with_exponent().unwrap_or((rest, value)))
}

/// Parses the end: nothing but blanks.
fn end(input: &str) -> Parsed<'_, ()> {
    if blank(input).is_empty() {
        Ok(("", ()))
    } else {
        fail(input, Mistake::Expected { what: Expected::End })
    }
}
