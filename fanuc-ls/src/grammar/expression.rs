//! Values, conditions and their parts.

use alloc::boxed::Box;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

use nom::Parser;

use super::{Parsed, blank, fail, is_word, keyword, next, number, or_fail, other, sign};
use crate::expression::{Expression, Function, Index, Item, ItemKind, Operator};
use crate::mistake::{Expected, Mistake};

/// How deep brackets may be: more than any instruction has, and few enough for any stack.
const DEEPEST: u8 = 24;

/// Parses a value or a condition.
pub(super) fn expression(input: &str) -> Parsed<'_, Expression> {
    without_edges(input, level(input, 0, DEEPEST)?)
}

/// Parses one value without an operator.
pub(super) fn value(input: &str) -> Parsed<'_, Expression> {
    without_edges(input, or_fail(input, Expected::Value, |input| operand(input, DEEPEST))?)
}

fn without_edges<'a>(input: &'a str, read: (&'a str, Expression)) -> Parsed<'a, Expression> {
    if has_misplaced_edge(&read.1) { fail(input, Mistake::Edge) } else { Ok(read) }
}

/// Returns whether `ON+` or `OFF-` stands elsewhere than after `=` or `<>`.
fn has_misplaced_edge(value: &Expression) -> bool {
    match value {
        Expression::Rising | Expression::Falling => true,
        Expression::Binary(operator, sides) => {
            let is_compared = matches!(operator, Operator::Equal | Operator::Unequal)
                && matches!(sides.1, Expression::Rising | Expression::Falling);
            has_misplaced_edge(&sides.0) || !is_compared && has_misplaced_edge(&sides.1)
        }
        _ => false,
    }
}

/// Reads an expression that is true or false. Outside of parentheses it is a comparison, and does not mix AND and OR.
pub(super) fn condition(input: &str) -> Parsed<'_, Expression> {
    let (rest, found) = level(input, 0, DEEPEST)?;
    let text = input.get(..input.len() - rest.len()).unwrap_or("");
    let is_bare = !blank(text).starts_with(['(', '!']);
    match &found {
        Expression::Item(_) if is_bare => fail(rest, Mistake::Expected { what: Expected::Comparison }),
        Expression::Number(_) | Expression::Text(_) | Expression::Negative(_) => {
            fail(rest, Mistake::Expected { what: Expected::Comparison })
        }
        found if has_misplaced_edge(found) => fail(input, Mistake::Edge),
        _ if is_bare && mixes(text) => fail(input, Mistake::MixedLogic),
        _ => Ok((rest, found)),
    }
}

/// Returns whether a text has both AND and OR outside its brackets.
fn mixes(text: &str) -> bool {
    let (mut depth, mut has) = (0i32, [false; 2]);
    for (at, c) in text.char_indices() {
        match c {
            '(' | '[' => depth += 1,
            ')' | ']' => depth -= 1,
            ' ' | '\t' if depth == 0 => {
                let rest = text.get(at..).unwrap_or("");
                for (has, word) in has.iter_mut().zip(["AND", "OR"]) {
                    *has |= next(rest, keyword(word)).is_some();
                }
            }
            _ => {}
        }
    }
    has == [true, true]
}

/// Parses one side of an operator that binds at least as strongly as `level_`.
fn level(input: &str, level_: u8, depth: u8) -> Parsed<'_, Expression> {
    if level_ == Operator::LEVELS {
        return or_fail(input, Expected::Value, |input| operand(input, depth));
    }
    let (mut rest, mut left) = level(input, level_ + 1, depth)?;
    while let Some((after, operator)) = operator(rest, level_) {
        let (behind, right) = level(after, level_ + 1, depth)?;
        left = Expression::Binary(operator, Box::new((left, right)));
        rest = behind;
    }
    Ok((rest, left))
}

fn operator(input: &str, level: u8) -> Option<(&str, Operator)> {
    let of_level = Operator::ALL.iter().filter(|(.., of)| *of == level);
    { of_level }.find_map(|(operator, text, _)| {
        let rest =
            if text.starts_with(is_word) { next(input, keyword(text)) } else { next(input, sign(text)) }?;
        Some((rest, *operator))
    })
}

fn operand(input: &str, depth: u8) -> Parsed<'_, Expression> {
    let Some(depth) = depth.checked_sub(1) else { return fail(input, Mistake::TooDeep) };
    for (word, value) in [
        ("ON", Expression::On),
        ("OFF", Expression::Off),
        ("AN", Expression::On),
        ("AUS", Expression::Off),
        ("LPOS", Expression::CartesianPosition),
        ("JPOS", Expression::JointPosition),
        ("Constant", Expression::Untaught),
    ] {
        let Some(rest) = next(input, keyword(word)) else { continue };
        let (edge, rest) = match value {
            Expression::On => (Some(Expression::Rising), rest.strip_prefix('+').ok_or(rest)),
            Expression::Off => (Some(Expression::Falling), rest.strip_prefix('-').ok_or(rest)),
            _ => (None, Err(rest)),
        };
        return match (edge, rest) {
            (Some(edge), Ok(rest)) if depth + 1 == DEEPEST => Ok((rest, edge)),
            (Some(_), Ok(_)) => fail(input, Mistake::Edge),
            (_, Ok(rest) | Err(rest)) => Ok((rest, value)),
        };
    }
    if let Some(rest) = next(input, keyword("ERR_NUM")) {
        // The alarm's facility and number; it is read as a system variable is.
        return Ok((rest, Expression::System("ERR_NUM".to_string())));
    }
    if let Some(rest) = next(input, sign("...")) {
        return Ok((rest, Expression::Untaught));
    }
    if let Some(rest) = next(input, sign("(")) {
        let (rest, inner) = level(rest, 0, depth)?;
        let (rest, ()) = or_fail(rest, Expected::Parenthesis, sign(")"))?;
        return Ok((rest, inner));
    }
    if let Some(rest) = next(input, sign("!")) {
        let (rest, inner) = or_fail(rest, Expected::Value, |input| operand(input, depth))?;
        return Ok((rest, Expression::Not(Box::new(inner))));
    }
    if let Some(rest) = next(input, sign("'")) {
        let Some((text, rest)) = rest.split_once('\'') else {
            return fail(rest, Mistake::Expected { what: Expected::Quote });
        };
        return Ok((rest, Expression::Text(text.to_string())));
    }
    if let Some(read) = next(input, sign("[")).and_then(pallet) {
        return Ok(read);
    }
    if let Ok((rest, number)) = number(input) {
        return Ok((rest, Expression::Number(number)));
    }
    if let Some(rest) = next(input, sign("-")) {
        let (rest, inner) = or_fail(rest, Expected::Value, |input| operand(input, depth))?;
        return Ok((rest, Expression::Negative(Box::new(inner))));
    }
    if blank(input).starts_with('$') {
        let (rest, name) = system(input)?;
        return Ok((rest, Expression::System(name.to_string())));
    }
    for (function, name) in Function::ALL {
        if let Some(rest) = next(input, keyword(name)) {
            return arguments(rest, *function, depth);
        }
    }
    let text = blank(input);
    let letters = text.find(|c| !is_word(c)).unwrap_or(text.len());
    let is_other = letters > 0 && text.get(letters..).is_some_and(|rest| rest.starts_with('['));
    let (rest, item) = match item_at(input, depth) {
        Err(nom::Err::Error(_)) if is_other => return fail(input, Mistake::UnknownItem),
        read => read?,
    };
    // A timer counts seconds; `TIMER[1]MS` is the same in milliseconds.
    if item.kind == ItemKind::Timer
        && let Some(rest) = next(rest, keyword("MS"))
    {
        let sides = (Expression::Item(item), Expression::Number(1000.0));
        return Ok((rest, Expression::Binary(Operator::Multiply, Box::new(sides))));
    }
    Ok((rest, Expression::Item(item)))
}

/// Parses a row, a column and a layer, some of which a comparison leaves open: `1,R[2],*]`.
fn pallet(input: &str) -> Option<(&str, Expression)> {
    let mut rest = input;
    for end in [",", ",", "]"] {
        rest = match next(rest, sign("*")) {
            Some(after) => after,
            None => index(rest, DEEPEST).ok()?.0,
        };
        rest = next(rest, sign(end))?;
    }
    let text = input.get(..input.len() - rest.len())?;
    Some((rest, Expression::Pallet(["[", text].concat())))
}

/// Reads the arguments of a function: in brackets, in parentheses, or for string functions after a blank.
fn arguments(input: &str, function: Function, depth: u8) -> Parsed<'_, Expression> {
    let open = [("[", "]", Expected::Bracket), ("(", ")", Expected::Parenthesis)];
    let open =
        open.into_iter().find_map(|(open, close, missing)| Some((next(input, sign(open))?, close, missing)));
    let mut rest = open.map_or(input, |(rest, ..)| rest);
    let mut values = Vec::new();
    loop {
        let (after, value) = level(rest, 0, depth)?;
        values.push(value);
        rest = after;
        match next(rest, sign(",")) {
            Some(after) => rest = after,
            None => break,
        }
    }
    if let Some((_, close, missing)) = open {
        (rest, ()) = or_fail(rest, missing, sign(close))?;
    }
    match function.arguments() == values.len() {
        true => Ok((rest, Expression::Call(function, values))),
        false => fail(rest, Mistake::Arguments { expected: function.arguments(), found: values.len() }),
    }
}

/// Reads a system variable: words that begin with `$`, with `.` between them and brackets after them.
pub(super) fn system(input: &str) -> Parsed<'_, &str> {
    let text = blank(input);
    let (mut depth, mut length) = (0i32, text.len());
    for (at, c) in text.char_indices() {
        match c {
            '[' => depth += 1,
            ']' => depth -= 1,
            ',' | ' ' if depth > 0 => {}
            c if is_word(c) || matches!(c, '$' | '.') => {}
            _ => depth = -1,
        }
        if depth < 0 {
            length = at;
            break;
        }
    }
    match text.split_at_checked(length) {
        Some((name, rest)) if name.starts_with('$') && name.len() > 1 => Ok((rest, name)),
        _ => other(input),
    }
}

/// Parses a register, an input, an output or a label.
pub(crate) fn item(input: &str) -> Parsed<'_, Item> {
    item_at(input, DEEPEST)
}

fn item_at(input: &str, depth: u8) -> Parsed<'_, Item> {
    let Some(depth) = depth.checked_sub(1) else { return fail(input, Mistake::TooDeep) };
    let text = blank(input);
    let length = text.find(|c| !is_word(c)).unwrap_or(text.len());
    let (letters, rest) = text.split_at_checked(length).unwrap_or(("", text));
    let Some(inner) = rest.strip_prefix('[') else { return other(input) };
    let Some(kind) = ItemKind::named(letters) else { return other(input) };
    let (inner, group) = group(inner);
    let (mut rest, index) = index(inner, depth)?;
    let mut element = None;
    if let Some(after) = next(rest, sign(",")) {
        let (after, found) = self::index(after, depth)?;
        (rest, element) = (after, Some(found));
    }
    let mut name = None;
    if let Some(after) = next(rest, sign(":")) {
        let Some(length) = closing(after) else {
            return fail(
                after.get(after.len()..).unwrap_or(""),
                Mistake::Expected { what: Expected::Bracket },
            );
        };
        let (text, after) = after.split_at_checked(length).unwrap_or((after, ""));
        (rest, name) = (after, Some(text.trim().to_string()));
    }
    let (mut rest, ()) = or_fail(rest, Expected::Bracket, sign("]"))?;
    if kind == ItemKind::VisionRegister {
        // The result follows a point: `VR[1].MODELID`.
        let field =
            rest.strip_prefix('.').map_or(0, |field| 1 + field.find(|c| !is_word(c)).unwrap_or(field.len()));
        rest = rest.get(field..).unwrap_or("");
    }
    Ok((rest, Item { kind, group, index, element, name }))
}

/// Parses `GP1:`, or `GP1,2:` with several groups.
fn group(input: &str) -> (&str, Option<u8>) {
    let parse = || {
        let (numbers, rest) = blank(input).strip_prefix("GP")?.split_once(':')?;
        let mut numbers = numbers.split(',').map(|number| number.trim().parse::<u8>());
        let first = numbers.next()?.ok()?;
        numbers.all(|number| number.is_ok()).then_some((rest, Some(first)))
    };
    parse().unwrap_or((input, None))
}

/// Returns the offset of the bracket that closes a name, which may contain brackets.
fn closing(text: &str) -> Option<usize> {
    let mut depth = 0usize;
    for (at, c) in text.char_indices() {
        match c {
            '[' => depth += 1,
            ']' if depth > 0 => depth -= 1,
            ']' => return Some(at),
            '\r' | '\n' => return None,
            _ => {}
        }
    }
    // A name may open a bracket and not close it.
    text.find(']')
}

/// Parses a number, an item that contains it, or `...`.
pub(super) fn index(input: &str, depth: u8) -> Parsed<'_, Index> {
    if let Some(rest) = next(input, sign("...")).or_else(|| next(input, keyword("Constant"))) {
        return Ok((rest, Index::Untaught));
    }
    let text = blank(input);
    let digits = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    if digits == 0 {
        let (rest, item) = or_fail(input, Expected::Number, |input| item_at(input, depth))?;
        return Ok((rest, Index::Item(Box::new(item))));
    }
    let (number, rest) = text.split_at_checked(digits).unwrap_or((text, ""));
    match number.parse() {
        Ok(number) => Ok((rest, Index::Number(number))),
        Err(_) => fail(input, Mistake::Expected { what: Expected::Number }),
    }
}

/// Reads the number in brackets after an instruction, with its comment: `[3:gripper]`.
pub(super) fn bracketed(input: &str) -> Parsed<'_, Index> {
    let (rest, ()) = sign("[").parse(input)?;
    index_to_bracket(rest)
}

/// Parses an index in brackets, with or without a motion group: `[GP2:3]`.
pub(super) fn bracketed_of_group(input: &str) -> Parsed<'_, Index> {
    let (rest, ()) = sign("[").parse(input)?;
    index_to_bracket(group(rest).0)
}

fn index_to_bracket(input: &str) -> Parsed<'_, Index> {
    let (mut rest, found) = index(input, DEEPEST)?;
    if let Some(after) = next(rest, sign(":")) {
        rest = after.get(closing(after).unwrap_or(after.len())..).unwrap_or("");
    }
    let (rest, ()) = or_fail(rest, Expected::Bracket, sign("]"))?;
    Ok((rest, found))
}

/// Parses a program's name, or the string register that contains it.
pub(super) fn name(input: &str) -> Parsed<'_, String> {
    let text = blank(input);
    if let Some(rest) = next(input, sign("...")) {
        return Ok((rest, "...".to_string()));
    }
    if let Ok((rest, item)) = item(input) {
        let name = text.get(..text.len() - rest.len()).unwrap_or("");
        return match item.kind {
            ItemKind::StringRegister | ItemKind::Argument => Ok((rest, name.to_string())),
            _ => fail(input, Mistake::Expected { what: Expected::Program }),
        };
    }
    let length = text.find(|c| !(is_word(c) || c == '-')).unwrap_or(text.len());
    match text.split_at_checked(length) {
        Some((name, rest)) if !name.is_empty() && !name.starts_with(|c: char| c.is_ascii_digit()) => {
            Ok((rest, name.to_string()))
        }
        _ => fail(input, Mistake::Expected { what: Expected::Program }),
    }
}
