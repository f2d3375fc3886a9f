//! Instructions other than motions, by the table.

use alloc::string::{String, ToString};
use alloc::vec::Vec;

use super::expression::{bracketed, bracketed_of_group, condition, expression, item, system};
use super::operation::{arguments, assign, in_range};
use super::table::{Context, Form, ROWS, Row};
use super::{LocatedMistake, Parsed, blank, end, fail, is_word, keyword, next, or_fail, other, sign};
use crate::expression::{Expression, Index};
use crate::mistake::{Expected, Mistake};
use crate::operation::Operation;

/// The longest text that is read: more than a controller's longest line.
const MAX_STATEMENT_LEN: usize = 4000;

/// Reads an instruction to its end.
pub(crate) fn operation(input: &str) -> Result<Operation, LocatedMistake<'_>> {
    if let Some(disabled) = input.strip_prefix("//") {
        return Ok(Operation::Disabled(disabled.to_string()));
    }
    if let Some(remark) = input.strip_prefix("--") {
        return Ok(Operation::Remark(remark.to_string()));
    }
    if input.len() > MAX_STATEMENT_LEN {
        return Err(LocatedMistake { at: input, mistake: Mistake::TooDeep });
    }
    let read = instruction(input, Context::Line).and_then(|(rest, found)| end(rest).map(|_| found));
    read.map_err(LocatedMistake::of)
}

/// Reads an instruction by the table, assignments and macros, which have no row.
pub(super) fn instruction(input: &str, place: Context) -> Parsed<'_, Operation> {
    for row in ROWS {
        for words in row.words {
            let read = if words.starts_with(is_word) {
                next(input, keyword(words))
            } else {
                next(input, sign(words))
            };
            let Some(rest) = read else { continue };
            if place == Context::Anywhere && row.place == Context::Line {
                return fail(input, Mistake::Expected { what: Expected::Action });
            }
            return form(rest, row.words.first().copied().unwrap_or(""), &row.form);
        }
    }
    if let Some(rest) = next(input, sign("...")) {
        // An instruction that a template leaves open.
        let operands = [Expression::Untaught].into();
        return Ok((rest, Operation::Command { name: "...", operands, text: String::new() }));
    }
    if blank(input).starts_with('$') {
        let (rest, variable) = system(input)?;
        let (rest, ()) = or_fail(rest, Expected::Equals, sign("="))?;
        let (rest, value) = expression(rest)?;
        return Ok((rest, Operation::AssignSystem(variable.to_string(), value)));
    }
    match item(input) {
        Ok((rest, item)) => assign(rest, item),
        Err(nom::Err::Error(_)) => named(input),
        Err(error) => Err(error),
    }
}

fn form<'a>(input: &'a str, name: &'static str, form: &Form) -> Parsed<'a, Operation> {
    let command = |rest: &'a str, operands: Vec<Expression>| {
        Ok((rest, Operation::Command { name, operands, text: String::new() }))
    };
    match form {
        Form::Alone(operation) => Ok((input, operation.clone())),
        Form::Own(parse) => parse(input),
        Form::Text => Ok((
            "",
            Operation::Command { name, operands: Vec::new(), text: blank(input).trim_end().to_string() },
        )),
        Form::State => {
            let (rest, state) = expression(input)?;
            command(rest, [state].into())
        }
        Form::Condition => {
            let (rest, found) = condition(input)?;
            command(rest, [found].into())
        }
        Form::Value(low, high) => {
            let (rest, found) = expression(input)?;
            in_range(input, &found, *low, *high)?;
            command(rest, [found].into())
        }
        Form::Set(low, high) => {
            let (rest, group) = match bracketed(input) {
                Ok((rest, group)) => (rest, Some(group)),
                Err(nom::Err::Error(_)) => (input, None),
                Err(error) => return Err(error),
            };
            let (rest, ()) = or_fail(rest, Expected::Equals, sign("="))?;
            let (behind, found) = expression(rest)?;
            in_range(rest, &found, *low, *high)?;
            let behind = ["%", "mm/sec"].iter().find_map(|unit| next(behind, sign(unit))).unwrap_or(behind);
            command(behind, [found].into_iter().chain(group.map(Into::into)).collect())
        }
        Form::Index(low, high) | Form::IndexOfGroup(low, high) => {
            let is_of_group = matches!(form, Form::IndexOfGroup(..));
            let parse = if is_of_group { bracketed_of_group } else { bracketed };
            let (rest, index) = or_fail(input, Expected::OpenBracket, parse)?;
            if matches!(index, Index::Number(number) if !(*low..=*high).contains(&number)) {
                return fail(input, Mistake::range((*low).into(), (*high).into()));
            }
            Ok((
                rest,
                match name {
                    "UALM" => Operation::UserAlarm(index),
                    "PAYLOAD" => Operation::Payload(index),
                    _ => Operation::Command { name, operands: [index.into()].into(), text: String::new() },
                },
            ))
        }
    }
}

/// Parses a macro by its name, or an unknown word.
fn named(input: &str) -> Parsed<'_, Operation> {
    let text = blank(input);
    if text.is_empty() {
        return other(input);
    }
    let first = text.find(|c| !is_word(c)).unwrap_or(text.len());
    let word = text.get(..first).unwrap_or("");
    let similar = similar(word, text.get(first..).unwrap_or(""));
    if let Some(mistake @ Mistake::Misspelled { .. }) = similar {
        return fail(text, mistake);
    }
    let is_name =
        |c: char| is_word(c) || matches!(c, ' ' | '.' | '-' | '/' | '#' | '&' | '+' | '>' | '?' | '%');
    let length = text.find(|c| !is_name(c)).unwrap_or(text.len());
    let (name, rest) = text.split_at_checked(length).unwrap_or((text, ""));
    let name = name.trim_end();
    let is_open = blank(rest).is_empty() || rest.starts_with(['(', ',']) || rest.starts_with(['\r', '\n']);
    if !text.starts_with(char::is_alphabetic) || name.len() > 36 || !is_open {
        return fail(text, similar.unwrap_or(Mistake::Unknown));
    }
    if let Some(mistake) = similar {
        return fail(text, mistake);
    }
    let (rest, arguments) = arguments(rest)?;
    Ok((rest, Operation::Macro { name: name.to_string(), arguments }))
}

/// Returns the mistake of a word that is similar to the name of an instruction. The word is misspelled if the rest fits that
/// instruction; otherwise it is an instruction that the table lacks.
fn similar(word: &str, after: &str) -> Option<Mistake> {
    // In English: words of other languages are too near to the names of macros.
    let first = |row: &Row| row.words.first()?.split(' ').next();
    let near = ROWS.iter().filter_map(|row| Some((row, first(row).filter(|known| is_near(word, known))?)));
    let mut similar = None;
    for (row, known) in near {
        let text = known.to_string() + after;
        let fits = row.words.first().is_some_and(|words| next(&text, keyword(words)).is_some())
            && instruction(&text, Context::Line).is_ok_and(|(rest, _)| end(rest).is_ok());
        match row.form {
            // Anything follows it: that this does shows nothing.
            Form::Text if fits => similar = similar.or(Some(Mistake::Similar { word: known })),
            _ if fits => return Some(Mistake::Misspelled { word: known }),
            _ => {}
        }
    }
    similar
}

/// Returns whether a word is another one with a letter missing, added or changed, or with two letters exchanged.
pub(super) fn is_near(word: &str, known: &str) -> bool {
    let (word, known) = (word.as_bytes(), known.as_bytes());
    if word.len() < 3 || known.len() < 3 {
        return false;
    }
    let same = |(a, b): &(&u8, &u8)| a.eq_ignore_ascii_case(b);
    let head = word.iter().zip(known).take_while(same).count();
    let tail = |skip: usize, skip_known: usize| {
        let word = word.get(head + skip..).unwrap_or(&[]);
        let known = known.get(head + skip_known..).unwrap_or(&[]);
        word.eq_ignore_ascii_case(known)
    };
    let swapped = match (word.get(head..head + 2), known.get(head..head + 2)) {
        (Some([a, b]), Some([c, d])) => a.eq_ignore_ascii_case(d) && b.eq_ignore_ascii_case(c) && tail(2, 2),
        _ => false,
    };
    swapped || tail(1, 1) && (word.len() > 3 || head > 0) || tail(1, 0) || tail(0, 1)
}

/// Returns the word at the beginning of a text whose case differs from the table's.
pub(crate) fn in_capitals(text: &str) -> Option<&'static str> {
    let length = text.find(|c| !is_word(c)).unwrap_or(text.len());
    let word = text.get(..length)?;
    let words = ROWS.iter().flat_map(|row| row.words).filter_map(|words| words.split(' ').next());
    let mut words = words.filter(|known| known.eq_ignore_ascii_case(word)).peekable();
    let first = *words.peek()?;
    words.all(|known| known != word).then_some(first)
}
