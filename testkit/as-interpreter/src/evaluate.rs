//! The evaluation of expressions.

use core::time::Duration;
use std::borrow::Cow;

use crate::error::Error;
use crate::expression::{Expression, Function, Operator, VariableRef};
use crate::memory::{Cell, Memory, index};
use crate::names::Variable;
use crate::value::{MAX_TEXT_LEN, Value, decimal, leading_number, whole};

/// The variables and the time for the evaluation of an expression.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scope<'a> {
    pub(crate) memory: &'a Memory,
    pub(crate) locals: &'a [Cell],
    pub(crate) now: Duration,
}

impl<'a> Scope<'a> {
    pub(crate) fn real(&self, expression: &'a Expression) -> Result<f32, Error> {
        self.value(expression)?.real()
    }

    pub(crate) fn index(&self, place: &'a VariableRef) -> Result<Option<usize>, Error> {
        place.index.as_ref().map(|i| index(&self.value(i)?)).transpose()
    }

    pub(crate) fn read(&self, variable: Variable, index: Option<usize>) -> Result<Value<'a>, Error> {
        let cell = match variable {
            Variable::Global(at) => self.memory.globals.get(at),
            Variable::Local(at) => self.locals.get(at),
        };
        cell.ok_or(Error::Undefined)?.get(index)
    }

    pub(crate) fn value(&self, expression: &'a Expression) -> Result<Value<'a>, Error> {
        Ok(match expression {
            Expression::Real(real) => Value::Real(*real),
            Expression::Text(text) => Value::Text(Cow::Borrowed(text)),
            Expression::Variable(place) => self.read(place.variable, self.index(place)?)?,
            Expression::Not(of) => Value::truth(!self.value(of)?.is_true()?),
            Expression::Negative(of) => Value::Real(-self.real(of)?),
            Expression::Binary(operator, sides) => {
                binary(*operator, self.value(&sides.0)?, self.value(&sides.1)?)?
            }
            Expression::Function(function, arguments) => self.function(*function, arguments)?,
        })
    }

    fn function(&self, function: Function, arguments: &'a [Expression]) -> Result<Value<'a>, Error> {
        let value = |i: usize| self.value(arguments.get(i).ok_or(Error::Argument)?);
        let first = value(0)?;
        Ok(match function {
            Function::Abs => Value::Real(first.real()?.abs()),
            Function::Int => Value::Real(first.real()?.trunc()),
            Function::Len => Value::Real(count(first.text()?.len())),
            Function::Val => Value::Real(leading_number(first.text()?)),
            Function::Instr => {
                let (text, part) = (first.text()?, value(1)?);
                let part = part.text()?;
                let found = match part {
                    [byte] => text.iter().position(|found| found == byte),
                    [] => None,
                    _ => text.windows(part.len()).position(|window| window == part),
                };
                Value::Real(found.map_or(0.0, |at| count(at + 1)))
            }
            Function::Left => {
                let length = length(&value(1)?)?;
                slice(first, |text| 0..length.min(text.len()))?
            }
            Function::Right => {
                let length = length(&value(1)?)?;
                slice(first, |text| text.len().saturating_sub(length)..text.len())?
            }
            Function::Mid => {
                let begin = length(&value(1)?)?.checked_sub(1).ok_or(Error::Argument)?;
                let length = if arguments.len() > 2 { length(&value(2)?)? } else { MAX_TEXT_LEN };
                slice(first, |text| begin.min(text.len())..(begin + length).min(text.len()))?
            }
            Function::Encode | Function::EncodeLeft => {
                let real = first.real()?;
                let blank = if function == Function::Encode && real >= 0.0 { " " } else { "" };
                Value::Text(Cow::Owned(format!("{blank}{}", decimal(real)).into_bytes()))
            }
            Function::Sig => {
                let signal = whole(first.real()?, Memory::SIGNALS).ok_or(Error::Argument)?;
                Value::truth(self.memory.signals.get(signal) == Some(&true))
            }
            Function::Timer => {
                let timer = whole(first.real()?, Memory::TIMERS).ok_or(Error::Argument)?;
                let begin = self.memory.timers.get(timer).copied().unwrap_or(0.0);
                Value::Real(real(self.now.as_secs_f64() - begin))
            }
            Function::Trans => {
                let mut pose = [0.0; 6];
                for (axis, argument) in pose.iter_mut().zip(arguments) {
                    *axis = self.real(argument)?;
                }
                Value::Pose(pose)
            }
        })
    }
}

fn binary<'a>(operator: Operator, left: Value<'a>, right: Value<'a>) -> Result<Value<'a>, Error> {
    if let (Value::Text(a), Value::Text(b)) = (&left, &right) {
        return match operator {
            Operator::Plus => Ok(Value::Text(Cow::Owned([a.as_ref(), b].concat()))),
            Operator::Equal => Ok(Value::truth(a == b)),
            Operator::NotEqual => Ok(Value::truth(a != b)),
            _ => Err(Error::Type),
        };
    }
    if let (Value::Pose(a), Value::Pose(b)) = (&left, &right) {
        // A frame that is turned is not needed.
        let [x, y, z, 0.0, 0.0, 0.0] = *a else { return Err(Error::Argument) };
        return match operator {
            Operator::Plus => Ok(Value::Pose([x + b[0], y + b[1], z + b[2], b[3], b[4], b[5]])),
            _ => Err(Error::Type),
        };
    }
    let (a, b) = (left.real()?, right.real()?);
    Ok(match operator {
        Operator::Or => Value::truth(a != 0.0 || b != 0.0),
        Operator::And => Value::truth(a != 0.0 && b != 0.0),
        Operator::Equal => Value::truth(a == b),
        Operator::NotEqual => Value::truth(a != b),
        Operator::Less => Value::truth(a < b),
        Operator::LessOrEqual => Value::truth(a <= b),
        Operator::Greater => Value::truth(a > b),
        Operator::GreaterOrEqual => Value::truth(a >= b),
        Operator::Plus => Value::Real(a + b),
        Operator::Minus => Value::Real(a - b),
        Operator::Times => Value::Real(a * b),
        Operator::Over | Operator::Modulo if b == 0.0 => return Err(Error::Division),
        Operator::Over => Value::Real(a / b),
        Operator::Modulo => Value::Real(a % b),
    })
}

fn slice<'a>(value: Value<'a>, range: impl Fn(&[u8]) -> core::ops::Range<usize>) -> Result<Value<'a>, Error> {
    match value {
        Value::Text(Cow::Borrowed(text)) => {
            Ok(Value::Text(Cow::Borrowed(text.get(range(text)).unwrap_or_default())))
        }
        Value::Text(Cow::Owned(text)) => {
            Ok(Value::Text(Cow::Owned(text.get(range(&text)).unwrap_or_default().to_vec())))
        }
        Value::Real(_) | Value::Pose(_) => Err(Error::Type),
    }
}

/// Returns a count of bytes; a missing one is an error.
fn length(value: &Value<'_>) -> Result<usize, Error> {
    whole(value.real()?, 1e6).ok_or(Error::Argument)
}

#[expect(clippy::cast_precision_loss, reason = "of a string, at most some hundred")]
fn count(of: usize) -> f32 {
    of as f32
}

#[expect(clippy::cast_possible_truncation, reason = "a real has 24 bits")]
fn real(of: f64) -> f32 {
    of as f32
}
