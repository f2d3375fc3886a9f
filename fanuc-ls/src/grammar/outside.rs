//! Instructions for the outside of the controller: requests that start programs, and sensors on a serial port.

use alloc::string::ToString;

use super::expression::{bracketed, item};
use super::operation::label_of;
use super::{Parsed, blank, fail, keyword, next, or_fail, sign};
use crate::expression::{Expression, Index, ItemKind};
use crate::mistake::{Expected, Mistake};
use crate::operation::Operation;

/// Parses `RSR[1]=ENABLE`: whether requests from outside start their programs.
pub(super) fn enable(input: &str) -> Parsed<'_, Operation> {
    let (rest, index) = or_fail(input, Expected::OpenBracket, bracketed)?;
    if matches!(index, Index::Number(number) if !(1..=8).contains(&number)) {
        return fail(input, Mistake::range(1.0, 8.0));
    }
    let (rest, ()) = or_fail(rest, Expected::Equals, sign("="))?;
    let Some((after, word)) =
        ["ENABLE", "DISABLE"].into_iter().find_map(|word| Some((next(rest, keyword(word))?, word)))
    else {
        return fail(rest, Mistake::Expected { what: Expected::Enable });
    };
    Ok((after, command("RSR", index.into(), word)))
}

/// Parses `SEND R[1]`: a number for a sensor.
pub(super) fn send(input: &str) -> Parsed<'_, Operation> {
    register(input).map(|(rest, register)| (rest, command("SEND", register, "")))
}

/// Parses `RCV R[1],LBL[1]`: a number from a sensor, and the label to which the program goes without one.
pub(super) fn receive(input: &str) -> Parsed<'_, Operation> {
    let (rest, register) = register(input)?;
    let (label, ()) = or_fail(rest, Expected::Comma, sign(","))?;
    let (rest, _) = label_of(label)?;
    let text = blank(label.get(..label.len() - rest.len()).unwrap_or(""));
    Ok((rest, command("RCV", register, text)))
}

fn register(input: &str) -> Parsed<'_, Expression> {
    let (rest, found) = or_fail(input, Expected::Register, item)?;
    match found.kind {
        ItemKind::Register => Ok((rest, Expression::Item(found))),
        _ => fail(input, Mistake::Expected { what: Expected::Register }),
    }
}

fn command(name: &'static str, operand: Expression, text: &str) -> Operation {
    Operation::Command { name, operands: [operand].into(), text: text.to_string() }
}
