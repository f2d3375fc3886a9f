//! Values: checks the numbers of registers, and the types of assignments.

use super::Findings;
use crate::expression::{Expression, Index, Item, ItemKind, Operator};
use crate::mistake::{Expected, Mistake};
use crate::operation::Operation;

/// The kind of a value, as far as its text shows it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    State,
    Number,
    Text,
    Position,
    Pallet,
    /// Any kind.
    Any,
}

pub(super) fn check(operation: &Operation, place: &str, found: &mut Findings<'_>) {
    let mut mistake = None;
    visit(operation, &mut |part| {
        let wrong = match part {
            Part::Target(item) => target(item),
            Part::Item(item) => number(item),
            Part::Value(value) => compared(value),
            Part::Assigned(item, value) => assigned(item, value),
        };
        mistake = mistake.or(wrong);
    });
    if let Some(mistake) = mistake {
        found.add(place, mistake);
    }
}

/// A part of an operation.
enum Part<'a> {
    /// An item that is set.
    Target(&'a Item),
    Item(&'a Item),
    Value(&'a Expression),
    Assigned(&'a Item, &'a Expression),
}

fn visit<'a>(operation: &'a Operation, found: &mut impl FnMut(Part<'a>)) {
    match operation {
        Operation::Assign(item, value) => {
            found(Part::Target(item));
            visit_item(item, found);
            found(Part::Assigned(item, value));
            visit_value(value, found);
        }
        Operation::Pulse(item, _)
        | Operation::Timer(item, _)
        | Operation::Label(item)
        | Operation::Jump(item) => {
            visit_item(item, found);
        }
        Operation::AssignSystem(_, value)
        | Operation::UserFrame(value)
        | Operation::UserTool(value)
        | Operation::Override(value)
        | Operation::Wait(value)
        | Operation::IfThen(value) => visit_value(value, found),
        Operation::WaitFor { condition, timeout } => {
            visit_value(condition, found);
            timeout.iter().for_each(|label| visit_item(label, found));
        }
        Operation::If(condition, then) | Operation::When(condition, then) => {
            visit_value(condition, found);
            visit(then, found);
        }
        Operation::Select(item, value, then) => {
            visit_item(item, found);
            visit_value(value, found);
            visit(then, found);
        }
        Operation::Case(value, then) => {
            visit_value(value, found);
            visit(then, found);
        }
        Operation::Otherwise(then) => visit(then, found),
        Operation::For { counter, from, to, .. } => {
            visit_item(counter, found);
            visit_value(from, found);
            visit_value(to, found);
        }
        Operation::Call { arguments: values, .. }
        | Operation::Macro { arguments: values, .. }
        | Operation::Command { operands: values, .. } => {
            values.iter().for_each(|value| visit_value(value, found));
        }
        _ => {}
    }
}

fn visit_value<'a>(value: &'a Expression, found: &mut impl FnMut(Part<'a>)) {
    value.visit(&mut |value| {
        found(Part::Value(value));
        if let Expression::Item(item) = value {
            visit_item(item, found);
        }
    });
}

fn visit_item<'a>(item: &'a Item, found: &mut impl FnMut(Part<'a>)) {
    found(Part::Item(item));
    for index in [Some(&item.index), item.element.as_ref()].into_iter().flatten() {
        if let Index::Item(inner) = index {
            visit_item(inner, found);
        }
    }
}

fn number(item: &Item) -> Option<Mistake> {
    let range = item.kind.range();
    match item.index {
        Index::Untaught => return Some(Mistake::Untaught),
        Index::Number(number) if !range.contains(&number) => {
            return Some(Mistake::range((*range.start()).into(), (*range.end()).into()));
        }
        _ => {}
    }
    match item.element {
        Some(Index::Number(element)) if !(1..=9).contains(&element) => {
            Some(Mistake::Range { low: 1, high: 9 })
        }
        _ => None,
    }
}

fn target(item: &Item) -> Option<Mistake> {
    let is_set = !(item.kind.is_input() || item.kind == ItemKind::Argument);
    (!is_set).then_some(Mistake::ReadOnly { item: item.kind })
}

fn kind(value: &Expression) -> Kind {
    match value {
        Expression::Number(_) | Expression::Negative(_) => Kind::Number,
        Expression::Text(_) => Kind::Text,
        Expression::On | Expression::Off | Expression::Rising | Expression::Falling | Expression::Not(_) => {
            Kind::State
        }
        Expression::CartesianPosition | Expression::JointPosition => Kind::Position,
        Expression::Item(item) => kind_of(item),
        Expression::Binary(operator, sides) => match operator {
            Operator::Or
            | Operator::And
            | Operator::Equal
            | Operator::Unequal
            | Operator::LessOrEqual
            | Operator::GreaterOrEqual
            | Operator::Less
            | Operator::Greater => Kind::State,
            _ => kind(&sides.0),
        },
        Expression::Pallet(_) => Kind::Pallet,
        Expression::System(_) | Expression::Call(..) | Expression::Untaught => Kind::Any,
    }
}

fn kind_of(item: &Item) -> Kind {
    match item.kind {
        kind if kind.is_state() => Kind::State,
        ItemKind::PositionRegister | ItemKind::Position | ItemKind::UserFrame | ItemKind::UserTool
            if item.element.is_none() =>
        {
            Kind::Position
        }
        ItemKind::StringRegister => Kind::Text,
        ItemKind::Argument | ItemKind::VisionRegister | ItemKind::PalletRegister | ItemKind::Label => {
            Kind::Any
        }
        _ => Kind::Number,
    }
}

/// Returns the mistake if the kinds of item and value differ. A register takes a state, as 0 or 1, and an output a register.
fn assigned(item: &Item, value: &Expression) -> Option<Mistake> {
    let is_constant = value.constant().is_some();
    let what = match (kind_of(item), kind(value)) {
        (Kind::State, Kind::Number) if is_constant => Expected::State,
        (Kind::State, Kind::Text | Kind::Position) => Expected::State,
        (Kind::Number, Kind::State) if matches!(value, Expression::On | Expression::Off) => Expected::Number,
        (Kind::Number, Kind::Text) if matches!(value, Expression::Text(_)) => Expected::Number,
        (Kind::Number, Kind::Position) => Expected::Number,
        (Kind::Position, Kind::Number | Kind::State | Kind::Text | Kind::Pallet) => Expected::Position,
        (Kind::Text, Kind::State | Kind::Position) => Expected::Text,
        (Kind::Number, Kind::Pallet) => Expected::Number,
        (Kind::State, Kind::Pallet) => Expected::State,
        (Kind::Text, Kind::Pallet) => Expected::Text,
        (Kind::Position, Kind::Position) => {
            let found = positions(value);
            return (found > 2).then_some(Mistake::PositionSum { found });
        }
        _ => return None,
    };
    Some(Mistake::Expected { what })
}

fn is_constant_state(value: &Expression) -> bool {
    matches!(value, Expression::On | Expression::Off | Expression::Rising | Expression::Falling)
}

/// Returns the number of positions that are added or subtracted.
fn positions(value: &Expression) -> u32 {
    match value {
        Expression::Binary(Operator::Add | Operator::Subtract, sides) => {
            positions(&sides.0) + positions(&sides.1)
        }
        value => u32::from(kind(value) == Kind::Position),
    }
}

/// Returns the mistake of a comparison of values that cannot be equal.
fn compared(value: &Expression) -> Option<Mistake> {
    if let Expression::Untaught = value {
        return Some(Mistake::Untaught);
    }
    let Expression::Binary(operator, sides) = value else { return None };
    let what = match (operator, kind(&sides.0), kind(&sides.1)) {
        (Operator::Equal | Operator::Unequal, Kind::State, Kind::Number) if sides.1.constant().is_some() => {
            Expected::State
        }
        (Operator::Equal | Operator::Unequal, Kind::Number, Kind::State) if is_constant_state(&sides.1) => {
            Expected::Number
        }
        (Operator::And | Operator::Or, left, right)
            if [left, right]
                .iter()
                .any(|kind| matches!(kind, Kind::Number | Kind::Text | Kind::Position)) =>
        {
            Expected::State
        }
        _ => return None,
    };
    Some(Mistake::Expected { what })
}
