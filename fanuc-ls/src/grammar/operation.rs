//! Instructions that are no motions.

use alloc::boxed::Box;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

use super::expression::{bracketed, bracketed_of_group, condition, expression, item, name, system, value};
use super::table::{Form, Place, ROWS, Row};
use super::{Parsed, Trouble, blank, end, fail, is_word, keyword, next, number, or_fail, other, sign};
use crate::expression::{Expression, Index, Item, ItemKind, Operator};
use crate::mistake::{Expected, Mistake};
use crate::operation::{Operation, TimerAction};

/// The longest text that is read: more than a controller's longest line.
const LONGEST: usize = 4000;

/// Reads an instruction to its end.
pub(crate) fn operation(input: &str) -> Result<Operation, Trouble<'_>> {
    if let Some(disabled) = input.strip_prefix("//") {
        return Ok(Operation::Disabled(disabled.to_string()));
    }
    if let Some(remark) = input.strip_prefix("--") {
        return Ok(Operation::Remark(remark.to_string()));
    }
    if input.len() > LONGEST {
        return Err(Trouble { at: input, mistake: Mistake::TooDeep });
    }
    let read = instruction(input, Place::Line).and_then(|(rest, found)| end(rest).map(|_| found));
    read.map_err(Trouble::of)
}

/// What may follow a condition and a comma.
pub(super) fn simple(input: &str) -> Parsed<'_, Operation> {
    instruction(input, Place::Anywhere)
}

fn instruction(input: &str, place: Place) -> Parsed<'_, Operation> {
    for row in ROWS {
        for words in row.words {
            let read = if words.starts_with(is_word) {
                next(input, keyword(words))
            } else {
                next(input, sign(words))
            };
            let Some(rest) = read else { continue };
            if place == Place::Anywhere && row.place == Place::Line {
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

fn in_range<'a>(at: &'a str, value: &Expression, low: f64, high: f64) -> Result<(), nom::Err<Trouble<'a>>> {
    match value.constant() {
        Some(number) if !(low..=high).contains(&number) => {
            fail(at, Mistake::range(low, high)).map(|_: (_, ())| ())
        }
        _ => Ok(()),
    }
}

/// The number of a frame, of a tool, or the override.
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
    // In mixed logic, the comma may be missing behind the parenthesis.
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

/// One of the conditions of a monitor.
pub(super) fn when(input: &str) -> Parsed<'_, Operation> {
    let (rest, condition) = condition(input)?;
    then(rest).map(|(rest, then)| (rest, Operation::When(condition, then)))
}

fn arguments(input: &str) -> Parsed<'_, Vec<Expression>> {
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

/// A value; in programs of an application also its own words, `ProgNr=31`, or nothing.
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

/// A label that something goes to.
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

/// What follows a register, an output, a timer.
fn assign(input: &str, item: Item) -> Parsed<'_, Operation> {
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

/// A macro by its name, or an unknown word.
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

/// The instruction that a word is nearly the name of. It is misspelled if what follows fits that instruction too, and
/// otherwise another one, which the table does not have.
fn similar(word: &str, after: &str) -> Option<Mistake> {
    // In English: words of other languages are too near to the names of macros.
    let first = |row: &Row| row.words.first()?.split(' ').next();
    let near = ROWS.iter().filter_map(|row| Some((row, first(row).filter(|known| is_near(word, known))?)));
    let mut similar = None;
    for (row, known) in near {
        let text = known.to_string() + after;
        let fits = row.words.first().is_some_and(|words| next(&text, keyword(words)).is_some())
            && instruction(&text, Place::Line).is_ok_and(|(rest, _)| end(rest).is_ok());
        match row.form {
            // Anything follows it: that this does shows nothing.
            Form::Text if fits => similar = similar.or(Some(Mistake::Similar { word: known })),
            _ if fits => return Some(Mistake::Misspelled { word: known }),
            _ => {}
        }
    }
    similar
}

/// Whether a word is another one with a letter missing, added, changed or two changed about.
pub(super) fn is_near(word: &str, known: &str) -> bool {
    let (word, known) = (word.as_bytes(), known.as_bytes());
    if word.len() < 3 || known.len() < 3 || word.len().abs_diff(known.len()) > 1 {
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

/// The word that a text begins with in other letters than the table's.
pub(crate) fn in_capitals(text: &str) -> Option<&'static str> {
    let length = text.find(|c| !is_word(c)).unwrap_or(text.len());
    let word = text.get(..length)?;
    let words = ROWS.iter().flat_map(|row| row.words).filter_map(|words| words.split(' ').next());
    let mut words = words.filter(|known| known.eq_ignore_ascii_case(word)).peekable();
    let first = *words.peek()?;
    words.all(|known| known != word).then_some(first)
}
