//! Texts, numbers and lists.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::ops::RangeInclusive;

use arbitrary::{Arbitrary, Result, Unstructured};

const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_";
const WORD: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_0123456789";
/// A byte is the character of that number.
const PHRASE: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_0123456789  .+-*/()<>!?\xE9\xFC";

/// Generates a word that does not begin with a digit.
pub(crate) fn word(u: &mut Unstructured<'_>) -> Result<String> {
    Ok(text(u, LETTERS, 1..=1)? + &text(u, WORD, 0..=35)?)
}

/// Generates a phrase of up to 16 characters, or nothing.
pub(crate) fn name(u: &mut Unstructured<'_>) -> Result<Option<String>> {
    if u.arbitrary()? { phrase(u).map(Some) } else { Ok(None) }
}

pub(crate) fn attribute_name(u: &mut Unstructured<'_>) -> Result<String> {
    const NAMES: [&str; 8] =
        ["OWNER", "COMMENT", "PROG_SIZE", "CREATE", "LINE_COUNT", "PROTECT", "TCD", "DEFAULT_GROUP"];
    if u.arbitrary()? { u.choose(&NAMES).map(ToString::to_string) } else { word(u) }
}

/// Generates the text of an attribute, with or without quotes.
pub(crate) fn attribute_text(u: &mut Unstructured<'_>) -> Result<String> {
    let text = phrase(u)?;
    Ok(if u.arbitrary()? { format!("\"{text}\"") } else { text })
}

pub(crate) fn attribute_list(u: &mut Unstructured<'_>) -> Result<Vec<(String, String)>> {
    (0..u.int_in_range(1..=6)?).map(|_| Ok((word(u)?, attribute_text(u)?))).collect()
}

pub(crate) fn application(u: &mut Unstructured<'_>) -> Result<Option<Vec<String>>> {
    let line = |u: &mut Unstructured<'_>| Ok(format!("  {} : {};", word(u)?, phrase(u)?));
    if u.arbitrary()? {
        (0..u.int_in_range(0..=4)?).map(|_| line(u)).collect::<Result<_>>().map(Some)
    } else {
        Ok(None)
    }
}

/// Generates a comment of one or two lines, with or without a blank before it.
pub(crate) fn comment(u: &mut Unstructured<'_>) -> Result<String> {
    let blank = if u.arbitrary()? { " " } else { "" };
    match u.int_in_range(0..=3u8)? {
        0 => Ok(String::new()),
        1 => Ok(format!("{blank}{}\n{}", phrase(u)?, phrase(u)?)),
        _ => Ok(format!("{blank}{};", phrase(u)?)),
    }
}

/// Generates an instruction of a common kind.
pub(crate) fn statement(u: &mut Unstructured<'_>) -> Result<String> {
    let (number, value): (u16, u16) = u.arbitrary()?;
    Ok(match u.int_in_range(0..=9u8)? {
        0 => format!("CALL {}", word(u)?),
        1 => format!("R[{number}]={value}"),
        2 => format!("DO[{number}]=ON"),
        3 => format!("WAIT DI[{number}]=OFF TIMEOUT,LBL[{value}]"),
        4 => format!("WAIT {}.{}0(sec)", number / 10, number % 10),
        5 => format!("LBL[{number}:{}]", phrase(u)?),
        6 => format!("IF R[{number}]={value},JMP LBL[{value}]"),
        7 => format!("SELECT R[{number}]={value},CALL {}\n={number},CALL {}", word(u)?, word(u)?),
        8 => format!("={value},CALL {}", word(u)?),
        _ => format!("OPEN HAND {}", phrase(u)?),
    })
}

pub(crate) fn nested(u: &mut Unstructured<'_>) -> Result<String> {
    let hundredths = u.int_in_range(0..=99u8)?;
    Ok(format!("     TB .{hundredths:02}sec,CALL {}", word(u)?))
}

/// Generates a target whose number is in a register, or of the first motion group.
pub(crate) fn target(u: &mut Unstructured<'_>) -> Result<String> {
    if u.arbitrary()? {
        Ok(format!("P[{}]", register(u)?))
    } else {
        Ok(format!("PR[GP1:{}]", u.arbitrary::<u16>()?))
    }
}

pub(crate) fn register(u: &mut Unstructured<'_>) -> Result<String> {
    let number: u16 = u.arbitrary()?;
    Ok(if u.arbitrary()? { format!("R[{number}:{}]", phrase(u)?) } else { format!("AR[{number}]") })
}

pub(crate) fn percent(u: &mut Unstructured<'_>) -> Result<u8> {
    u.int_in_range(0..=100)
}

pub(crate) fn digit(u: &mut Unstructured<'_>) -> Result<u8> {
    u.int_in_range(1..=9)
}

pub(crate) fn keyword(u: &mut Unstructured<'_>) -> Result<String> {
    u.choose(&["CONFIG", "KONFIG"]).map(ToString::to_string)
}

/// Generates the configuration of an arm: `N U T, 0, 0, 0`.
pub(crate) fn solution(u: &mut Unstructured<'_>) -> Result<String> {
    let letter = |u: &mut Unstructured<'_>, of: &[char; 2]| u.choose(of).copied();
    let (wrist, elbow, arm) = (letter(u, &['N', 'F'])?, letter(u, &['U', 'D'])?, letter(u, &['T', 'B'])?);
    let [first, second, third]: [i8; 3] = u.arbitrary()?;
    Ok(format!("{wrist} {elbow} {arm}, {first}, {second}, {third}"))
}

/// Generates a number with three decimals, as controllers print it, or with any number of decimals.
pub(crate) fn coordinate(u: &mut Unstructured<'_>) -> Result<Option<f64>> {
    Ok(match u.int_in_range(0..=3u8)? {
        0 => None,
        1 => Some(u.arbitrary().map(|value: f64| if value.is_finite() { value } else { 0.0 })?),
        _ => Some(f64::from(u.int_in_range(-9_999_999..=9_999_999)?) / 1000.0),
    })
}

pub(crate) fn options(u: &mut Unstructured<'_>, most: usize) -> Result<String> {
    let option = |u: &mut Unstructured<'_>| {
        let number: u8 = u.arbitrary()?;
        Ok(match u.int_in_range(0..=3u8)? {
            0 => format!("ACC{number}"),
            1 => format!("Offset,PR[{number}]"),
            2 => format!("Tool_Offset,PR[{number}]"),
            _ => "Wjnt".to_string(),
        })
    };
    let options: Vec<_> = (0..u.int_in_range(0..=most)?).map(|_| option(u)).collect::<Result<_>>()?;
    Ok(options.join(if u.arbitrary()? { "\n" } else { " " }))
}

/// Generates text that is not empty, without blanks around it.
fn phrase(u: &mut Unstructured<'_>) -> Result<String> {
    Ok((text(u, LETTERS, 1..=1)? + &text(u, PHRASE, 0..=15)?).trim_end().to_string())
}

pub(crate) fn text(u: &mut Unstructured<'_>, of: &[u8], length: RangeInclusive<usize>) -> Result<String> {
    (0..u.int_in_range(length)?).map(|_| u.choose(of).map(|byte| char::from(*byte))).collect()
}

/// Generates a list of values.
pub(crate) fn list<'a, const MIN: usize, const MAX: usize, T: Arbitrary<'a>>(
    u: &mut Unstructured<'a>,
) -> Result<Vec<T>> {
    (0..u.int_in_range(MIN..=MAX)?).map(|_| u.arbitrary()).collect()
}
