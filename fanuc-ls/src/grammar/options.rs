//! The options after a motion.

use super::expression::{index, item};
use super::instruction::is_near;
use super::operation::label_of;
use super::{LocatedMistake, Parsed, blank, fail, is_word, keyword, next, number, or_fail, sign, simple};
use crate::expression::ItemKind;
use crate::mistake::{Expected, Mistake};

/// An option after a motion, and the form of its arguments.
pub(crate) struct Choice {
    pub(crate) words: &'static [&'static str],
    pub(crate) form: fn(&str) -> Parsed<'_, ()>,
}

const fn choice(words: &'static [&'static str], form: fn(&str) -> Parsed<'_, ()>) -> Choice {
    Choice { words, form }
}

/// The options that may follow the speed and the termination of a motion.
pub(crate) static OPTIONS: &[Choice] = &[
    choice(&["FINE"], nothing),
    choice(&["ACC"], |input| amount(input, 0.0, 500.0)),
    choice(&["CD"], |input| amount(input, 0.0, 1000.0)),
    choice(&["CR"], corner),
    choice(&["CTV"], |input| optional_amount(input, -100.0, 100.0)),
    choice(&["PSPD"], |input| amount(input, 0.0, 500.0)),
    choice(&["AP_LD"], |input| amount(input, 0.0, 100_000.0)),
    choice(&["RT_LD"], |input| amount(input, 0.0, 100_000.0)),
    choice(&["RampTo"], |input| amount(input, 0.0, 100_000.0)),
    choice(&["Ind.EV"], |input| amount(input, 0.0, 100.0)),
    choice(&["EV"], |input| amount(input, 0.0, 100.0)),
    choice(&["Skip", "Interrupt"], skip),
    choice(&["SkipJump"], skip),
    choice(&["Offset"], optional_register),
    choice(&["Tool_Offset", "WKZ_Offset"], optional_register),
    choice(&["VOFFSET"], optional_register),
    choice(&["TB", "TIME BEFORE", "ZEIT VOR"], action),
    choice(&["TA", "TIME AFTER", "ZEIT NACH"], action),
    choice(&["DB", "DISTANCE BEFORE", "WEG VOR"], action),
    choice(&["DA", "DISTANCE AFTER"], action),
    choice(&["PTH"], nothing),
    choice(&["ALIM"], |input| optional_amount(input, 0.0, 100_000.0)),
    choice(&["FPLIN"], nothing),
    choice(&["ORNT_BASE"], to_end),
    choice(&["TA_REF"], to_end),
    choice(&["COORD"], coordinated),
    choice(&["INC"], nothing),
    choice(&["Wjnt"], nothing),
    choice(&["RTCP"], nothing),
    choice(&["MROT"], nothing),
    choice(&["BREAK"], nothing),
    choice(&["COND"], nothing),
    choice(&["CALL"], to_end),
    choice(&["Arc Start"], bracketed),
    choice(&["Arc End"], bracketed),
    choice(&["Weld Start"], bracketed),
    choice(&["Weld End"], bracketed),
    choice(&["Weave"], to_end),
    choice(&["Search"], bracketed),
    choice(&["SPOT"], bracketed),
    choice(&["PRESSURE"], bracketed),
    choice(&["Touch"], bracketed),
    choice(&["TC"], to_end),
];

/// Reads the options of a motion; the error is the mistake in the first that does not fit.
pub(crate) fn options(input: &str) -> Result<(), LocatedMistake<'_>> {
    let mut rest = input;
    while let Some((after, _)) = option(rest)? {
        rest = after;
    }
    Ok(())
}

/// Returns the next option, whole, and the text after it; `None` at the end.
pub(crate) fn option(input: &str) -> Result<Option<(&str, &str)>, LocatedMistake<'_>> {
    let mut rest = input;
    if !blank(rest).is_empty() {
        // A comma between two of them is a person's.
        rest = next(rest, sign(",")).unwrap_or(rest);
        for choice in OPTIONS {
            for words in choice.words {
                if let Some(after) = begins(rest, words) {
                    let (after, ()) = (choice.form)(after).map_err(LocatedMistake::of)?;
                    let text = blank(rest);
                    return Ok(Some((after, text.get(..text.len() - after.len()).unwrap_or(text))));
                }
            }
        }
        let text = blank(rest);
        let length = text.find(|c: char| !is_word(c)).unwrap_or(text.len());
        let word = text.get(..length).unwrap_or("");
        let after = text.get(length..).unwrap_or("");
        let fits = |choice: &&Choice| (choice.form)(after).is_ok();
        let known = OPTIONS.iter().filter(fits).flat_map(|choice| choice.words);
        let mistake = match { known }.find(|known| is_near(word, known)) {
            Some(word) => Mistake::Misspelled { word },
            None => Mistake::UnknownOption,
        };
        return Err(LocatedMistake { at: text, mistake });
    }
    Ok(None)
}

/// Returns the text after the words of an option; a number may follow them without a blank: `ACC100`.
fn begins<'a>(input: &'a str, words: &'static str) -> Option<&'a str> {
    let mut rest = input;
    for word in words.split(' ') {
        rest = blank(rest);
        let (found, after) = rest.split_at_checked(word.len())?;
        if !found.eq_ignore_ascii_case(word) {
            return None;
        }
        rest = after;
    }
    // A register may follow without a blank as well: `RT_LDR[1]`.
    let is_register = ["R[", "AR["].iter().any(|register| rest.starts_with(register));
    (is_register || !rest.starts_with(|c: char| c.is_alphabetic() || c == '_')).then_some(rest)
}

fn nothing(input: &str) -> Parsed<'_, ()> {
    Ok((input, ()))
}

/// Parses a number within a range, or a register; a percent sign may follow.
fn amount(input: &str, low: f64, high: f64) -> Parsed<'_, ()> {
    let rest = match number(input) {
        Ok((rest, value)) if (low..=high).contains(&value) => rest,
        Ok(_) => return fail(input, Mistake::range(low, high)),
        Err(_) => or_fail(input, Expected::Number, item)?.0,
    };
    Ok((next(rest, sign("%")).unwrap_or(rest), ()))
}

/// Parses the same, or nothing: `CTV`, `CTV50`.
fn optional_amount(input: &str, low: f64, high: f64) -> Parsed<'_, ()> {
    match number(input).is_ok() || item(input).is_ok() {
        true => amount(input, low, high),
        false => Ok((input, ())),
    }
}

/// Parses `CR5`, or with a second distance `CR5,10`.
fn corner(input: &str) -> Parsed<'_, ()> {
    let (rest, ()) = amount(input, 0.0, 1000.0)?;
    match next(rest, sign(",")).filter(|after| number(after).is_ok()) {
        Some(after) => amount(after, 0.0, 1000.0),
        None => Ok((rest, ())),
    }
}

/// Parses `Skip,LBL[1]`, and the register that stores the position: `,PR[1]=LPOS`.
fn skip(input: &str) -> Parsed<'_, ()> {
    let (rest, ()) = or_fail(input, Expected::Comma, sign(","))?;
    let (rest, _) = label_of(rest)?;
    let Some(after) = next(rest, sign(",")).filter(|after| blank(after).starts_with("PR")) else {
        return Ok((rest, ()));
    };
    simple(after).map(|(rest, _)| (rest, ()))
}

/// Parses `Offset`, `Offset,PR[1]`.
fn optional_register(input: &str) -> Parsed<'_, ()> {
    let Some(after) = next(input, sign(",")) else { return Ok((input, ())) };
    let (rest, register) = match after.trim_start().get(..2) {
        // A post-processor's comma before the next option.
        Some(letters) if !letters.eq_ignore_ascii_case("PR") && !letters.eq_ignore_ascii_case("VR") => {
            return fail(after, Mistake::Expected { what: Expected::PositionRegister });
        }
        _ => or_fail(after, Expected::PositionRegister, item)?,
    };
    match register.kind {
        ItemKind::PositionRegister | ItemKind::VisionRegister => Ok((rest, ())),
        _ => fail(after, Mistake::Expected { what: Expected::PositionRegister }),
    }
}

/// Parses `COORD`, `COORD[1]`, `COORD[R[1]]`.
fn coordinated(input: &str) -> Parsed<'_, ()> {
    let Some(rest) = next(input, sign("[")) else { return Ok((input, ())) };
    let (rest, _) = index(rest, 4)?;
    or_fail(rest, Expected::Bracket, sign("]"))
}

/// Parses `TB .50sec,CALL A`: a time or a distance, and the action there.
fn action(input: &str) -> Parsed<'_, ()> {
    let (mut rest, ()) = amount(input, -100_000.0, 100_000.0)?;
    let units = ["sec", "sek", "mm"];
    match units.iter().find_map(|unit| next(rest, keyword(unit))) {
        Some(after) => rest = after,
        None => return fail(rest, Mistake::Expected { what: Expected::Unit }),
    }
    let (rest, ()) = or_fail(rest, Expected::Comma, sign(","))?;
    if let Some(after) = next(rest, keyword("P-SPS")).or_else(|| next(rest, keyword("POINT_LOGIC"))) {
        return Ok((after, ()));
    }
    let (rest, _) = or_fail(rest, Expected::Action, simple)?;
    Ok((rest, ()))
}

/// Parses `Arc Start[1]`, with other equipment `Arc Start E2[1]`: an application's arguments in brackets.
fn bracketed(input: &str) -> Parsed<'_, ()> {
    let equipment =
        blank(input).strip_prefix('E').map(|rest| rest.trim_start_matches(|c: char| c.is_ascii_digit()));
    let (rest, ()) = or_fail(equipment.unwrap_or(input), Expected::Bracket, sign("["))?;
    // Registers inside have brackets of their own.
    let mut depth = 1usize;
    for (at, c) in rest.char_indices() {
        match c {
            '[' => depth += 1,
            ']' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return Ok((rest.get(at + 1..).unwrap_or(""), ()));
        }
    }
    fail(rest, Mistake::Expected { what: Expected::Bracket })
}

/// Parses the text of an application up to the end of the options.
fn to_end(_: &str) -> Parsed<'_, ()> {
    Ok(("", ()))
}
