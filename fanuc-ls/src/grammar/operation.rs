//! The forms of instructions other than motions, after their words.

use alloc::boxed::Box;
use alloc::string::ToString;
use alloc::vec::Vec;

use super::expression::{bracketed, condition, expression, item, name, value};
use super::{LocatedMistake, Parsed, blank, fail, keyword, next, number, or_fail, other, sign, simple};
use crate::expression::{Expression, Index, Item, ItemKind, Operator};
use crate::mistake::{Expected, Mistake};
use crate::operation::{Operation, TimerAction};

pub(super) fn in_range<'a>(
    at: &'a str,
    value: &Expression,
    low: f64,
    high: f64,
) -> Result<(), nom::Err<LocatedMistake<'a>>> {
    match value.constant() {
        Some(number) if !(low..=high).contains(&number) => {
            fail(at, Mistake::range(low, high)).map(|_: (_, ())| ())
        }
        _ => Ok(()),
    }
}

/// Parses an assignment to the number of a frame, to that of a tool, or to the override.
pub(super) fn assign_to(input: &str, which: usize) -> Parsed<'_, Operation> {
    let limits = [(0.0, 61.0), (0.0, 30.0), (1.0, 100.0)];
    let (low, high) = limits.get(which).copied().unwrap_or_default();
    let mut rest = input;
    if let Some(after) = next(input, sign("[")).filter(|_| which < 2) {
        // Of one group: `UTOOL_NUM[GP2]=1`.
        let Some((_, after)) = after.split_once(']') else {
            return fail(after, Mistake::Expected { what: Expected::Bracket });
        };
        rest = after;
    }
    let (rest, ()) = or_fail(rest, Expected::Equals, sign("="))?;
    let (behind, found) = expression(rest)?;
    in_range(rest, &found, low, high)?;
    let behind = if which == 2 { next(behind, sign("%")).unwrap_or(behind) } else { behind };
    let operation =
        [Operation::UserFrame, Operation::UserTool, Operation::Override as fn(Expression) -> Operation];
    operation.get(which).map_or_else(|| other(input), |operation| Ok((behind, operation(found))))
}

pub(super) fn decide(input: &str) -> Parsed<'_, Operation> {
    let (rest, found) = condition(input)?;
    if let Some(rest) = next(rest, keyword("THEN")).or_else(|| next(rest, keyword("DANN"))) {
        return match blank(input).starts_with('(') {
            true => Ok((rest, Operation::IfThen(found))),
            false => fail(input, Mistake::Expected { what: Expected::OpenParenthesis }),
        };
    }
    // In mixed logic, the comma may be missing after the parenthesis.
    let text = input.get(..input.len() - rest.len()).unwrap_or("");
    let is_closed = text.trim_end().ends_with(')');
    let rest = match next(rest, sign(",")) {
        Some(rest) => rest,
        None if is_closed && simple(rest).is_ok_and(|(_, then)| !matches!(then, Operation::Macro { .. })) => {
            rest
        }
        None => return fail(rest, Mistake::Expected { what: Expected::Then }),
    };
    let (rest, then) = or_fail(rest, Expected::Action, simple)?;
    Ok((rest, Operation::If(found, Box::new(then))))
}

pub(super) fn otherwise(input: &str) -> Parsed<'_, Operation> {
    if blank(input).is_empty() {
        return Ok((input, Operation::Else));
    }
    let (rest, then) = then(input)?;
    Ok((rest, Operation::Otherwise(then)))
}

pub(super) fn select(input: &str) -> Parsed<'_, Operation> {
    let (rest, item) = match next(input, sign("...")) {
        Some(rest) => {
            let (kind, index) = (ItemKind::Register, Index::Untaught);
            (rest, Item { kind, group: None, index, element: None, name: None })
        }
        None => or_fail(input, Expected::Register, item)?,
    };
    let (rest, ()) = or_fail(rest, Expected::Equals, sign("="))?;
    let (rest, value) = value(rest)?;
    let (rest, then) = then(rest)?;
    Ok((rest, Operation::Select(item, value, then)))
}

pub(super) fn case(input: &str) -> Parsed<'_, Operation> {
    let (rest, value) = value(next(input, sign("=")).unwrap_or(input))?;
    let (rest, then) = then(rest)?;
    Ok((rest, Operation::Case(value, then)))
}

fn then(input: &str) -> Parsed<'_, Box<Operation>> {
    let (rest, ()) = or_fail(input, Expected::Comma, sign(","))?;
    let (rest, then) = or_fail(rest, Expected::Action, simple)?;
    Ok((rest, Box::new(then)))
}

pub(super) fn count(input: &str) -> Parsed<'_, Operation> {
    let (rest, counter) = or_fail(input, Expected::Register, item)?;
    if counter.kind != ItemKind::Register {
        return fail(input, Mistake::Expected { what: Expected::Register });
    }
    let (rest, ()) = or_fail(rest, Expected::Equals, sign("="))?;
    let (rest, from) = value(rest)?;
    let down = next(rest, keyword("DOWNTO"));
    let Some(rest) = down.or_else(|| next(rest, keyword("TO"))) else {
        return fail(rest, Mistake::Expected { what: Expected::To });
    };
    let (rest, to) = value(rest)?;
    Ok((rest, Operation::For { counter, from, to, down: down.is_some() }))
}

pub(super) fn wait(input: &str) -> Parsed<'_, Operation> {
    if let Ok((rest, seconds)) = number(input)
        && let Some(rest) = next(rest, sign("(sec)")).or_else(|| next(rest, sign("(sek)")))
    {
        return match seconds >= 0.0 {
            true => Ok((rest, Operation::Wait(Expression::Number(seconds)))),
            false => fail(input, Mistake::range(0.0, 21_474_836.0)),
        };
    }
    if let Ok((rest, _)) = number(input) {
        return match blank(rest).is_empty() || next(rest, keyword("sec")).is_some() {
            true => fail(rest, Mistake::Expected { what: Expected::Seconds }),
            false => fail(rest, Mistake::Expected { what: Expected::Comparison }),
        };
    }
    if let Ok((rest, Expression::Untaught)) = value(input)
        && let Some(rest) = next(rest, sign("(sec)"))
    {
        return Ok((rest, Operation::Wait(Expression::Untaught)));
    }
    if let Ok((rest, Expression::Item(found))) = value(input)
        && matches!(found.kind, ItemKind::Register | ItemKind::Argument)
        && (blank(rest).is_empty() || next(rest, sign("(sec)")).is_some())
    {
        let rest = next(rest, sign("(sec)")).unwrap_or(rest);
        return Ok((rest, Operation::Wait(Expression::Item(found))));
    }
    let (mut rest, condition) = condition(input)?;
    let mut timeout = None;
    if let Some(after) = next(rest, keyword("TIMEOUT")) {
        let (after, ()) = or_fail(after, Expected::Comma, sign(","))?;
        let (after, found) = label_of(after)?;
        (rest, timeout) = (after, Some(found));
    }
    Ok((rest, Operation::WaitFor { condition, timeout }))
}

pub(super) fn call(input: &str) -> Parsed<'_, Operation> {
    let (rest, program) = name(input)?;
    let (rest, arguments) = arguments(rest)?;
    Ok((rest, Operation::Call { program, arguments }))
}

pub(super) fn run(input: &str) -> Parsed<'_, Operation> {
    let (rest, program) = name(input)?;
    let (rest, _) = arguments(rest)?;
    Ok((rest, Operation::Run(program)))
}

pub(super) fn monitor(input: &str) -> Parsed<'_, Operation> {
    name(input).map(|(rest, program)| (rest, Operation::Monitor(program)))
}

/// Parses one of the conditions of a monitor.
pub(super) fn when(input: &str) -> Parsed<'_, Operation> {
    let (rest, condition) = condition(input)?;
    then(rest).map(|(rest, then)| (rest, Operation::When(condition, then)))
}

pub(super) fn arguments(input: &str) -> Parsed<'_, Vec<Expression>> {
    let mut arguments = Vec::new();
    let Some(mut rest) = next(input, sign("(")) else { return Ok((input, arguments)) };
    loop {
        let (after, argument) = argument(rest)?;
        arguments.push(argument);
        rest = after;
        match next(rest, sign(",")) {
            Some(after) => rest = after,
            None => break,
        }
    }
    let (rest, ()) = or_fail(rest, Expected::Parenthesis, sign(")"))?;
    Ok((rest, arguments))
}

/// Parses a value; in programs of an application also its own words, `ProgNr=31`, or nothing.
fn argument(input: &str) -> Parsed<'_, Expression> {
    let error = match expression(input) {
        Ok((rest, value)) if blank(rest).starts_with([',', ')']) => return Ok((rest, value)),
        Ok((rest, _)) => fail(rest, Mistake::Expected { what: Expected::Parenthesis }),
        Err(error) => Err(error),
    };
    let length = input.find([',', ')', '\n']).unwrap_or(input.len());
    let (text, rest) = input.split_at_checked(length).unwrap_or((input, ""));
    let is_word = text.starts_with(|c: char| c.is_alphabetic() || c == ' ');
    let is_named = is_word && text.contains('=');
    if is_named || is_word && !text.contains(['[', '+', '*', '\'']) {
        return Ok((rest, Expression::Text(text.trim().to_string())));
    }
    error
}

pub(super) fn jump(input: &str) -> Parsed<'_, Operation> {
    label_of(input).map(|(rest, label)| (rest, Operation::Jump(label)))
}

/// Parses a label as a jump target.
pub(super) fn label_of(input: &str) -> Parsed<'_, Item> {
    let (rest, label) = or_fail(input, Expected::Label, item)?;
    match label.kind {
        ItemKind::Label => Ok((rest, label)),
        _ => fail(input, Mistake::Expected { what: Expected::Label }),
    }
}

pub(super) fn label(input: &str) -> Parsed<'_, Operation> {
    // The word has been read: it is the item's.
    if !blank(input).starts_with('[') {
        return fail(input, Mistake::Expected { what: Expected::OpenBracket });
    }
    let (rest, index) = bracketed(input)?;
    let text = input.get(..input.len() - rest.len()).unwrap_or("");
    let name = text.split_once(':').and_then(|(_, name)| name.rsplit_once(']'));
    let name = name.map(|(name, _)| name.trim().to_string());
    let label = Item { kind: ItemKind::Label, group: None, index, element: None, name };
    Ok((rest, Operation::Label(label)))
}

pub(super) fn message(input: &str) -> Parsed<'_, Operation> {
    let (rest, ()) = or_fail(input, Expected::OpenBracket, sign("["))?;
    match rest.rsplit_once(']') {
        Some((text, rest)) => Ok((rest, Operation::Message(text.to_string()))),
        None => fail(rest.get(rest.len()..).unwrap_or(""), Mistake::Expected { what: Expected::Bracket }),
    }
}

/// Reads the assignment to a register, an output or a timer.
pub(super) fn assign(input: &str, item: Item) -> Parsed<'_, Operation> {
    // A timer counts seconds; `TIMER[1]MS` is set in milliseconds.
    let milliseconds = next(input, keyword("MS")).filter(|_| item.kind == ItemKind::Timer);
    let (rest, ()) = or_fail(milliseconds.unwrap_or(input), Expected::Equals, sign("="))?;
    if item.kind == ItemKind::Timer {
        let actions = [
            ("START", TimerAction::Start),
            ("STOP", TimerAction::Stop),
            ("STOPP", TimerAction::Stop),
            ("RESET", TimerAction::Reset),
        ];
        if let Some((rest, action)) =
            actions.into_iter().find_map(|(word, action)| Some((next(rest, keyword(word))?, action)))
        {
            return Ok((rest, Operation::Timer(item, action)));
        }
    }
    if let Some(after) = next(rest, keyword("PULSE")) {
        let is_pulsed = matches!(
            item.kind,
            ItemKind::DigitalOutput
                | ItemKind::RobotOutput
                | ItemKind::WeldOutput
                | ItemKind::WireOutput
                | ItemKind::SpotOutput
        );
        if !is_pulsed {
            return fail(rest, Mistake::Expected { what: Expected::Value });
        }
        let Some(after) = next(after, sign(",")) else { return Ok((after, Operation::Pulse(item, None))) };
        let (after, seconds) = or_fail(after, Expected::Number, number)?;
        let Some(after) = next(after, keyword("sec")).or_else(|| next(after, keyword("sek"))) else {
            return fail(after, Mistake::Expected { what: Expected::Unit });
        };
        return Ok((after, Operation::Pulse(item, Some(seconds))));
    }
    let (rest, mut value) = expression(rest)?;
    if milliseconds.is_some() {
        value = Expression::Binary(Operator::Divide, Box::new((value, Expression::Number(1000.0))));
    }
    Ok((rest, Operation::Assign(item, value)))
}
