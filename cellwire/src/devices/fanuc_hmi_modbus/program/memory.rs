//! The memory of a program: registers, position registers, strings, timers, inputs and outputs.

use std::collections::{BTreeMap, HashMap};

use fanuc_hmi_modbus::Signal;
use fanuc_ls::{AxisName, Expression, Function, Index, Item, ItemKind, Operator};

use super::position::RobotPosition;
use cellwire_sim::fanuc::Tables;

/// Everything but the tables of signals, which the Modbus server has.
#[derive(Debug, Clone, Default)]
pub struct Memory {
    /// The values of R\[n\] by n, as far as they are set.
    pub numbers: BTreeMap<u32, f64>,
    /// The values of PR\[n\] by n, as far as they are set.
    pub positions: BTreeMap<u32, RobotPosition>,
    /// The values of SR\[n\] by n, as far as they are set.
    pub strings: BTreeMap<u32, String>,
    /// UFRAME\[n\] and UTOOL\[n\], as far as the program has set them.
    pub frames: BTreeMap<(bool, u32), [f64; 6]>,
    /// The pulses: the time at which each ends, in s, and its signal.
    pub pulses: Vec<(f64, Signal)>,
    /// System variables, as far as the program has set them.
    pub system: BTreeMap<String, f64>,
    /// Signals beyond the tables of the Modbus server, as DO\[11025\]: a controller has them all the same.
    beyond: HashMap<Signal, u16>,
    markers: BTreeMap<u32, bool>,
    timers: BTreeMap<u32, Timer>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Timer {
    seconds: f64,
    since: Option<f64>,
}

/// A value of an expression.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// The value of a register, an input or a calculation.
    Number(f64),
    /// The state of a signal or a condition: on or off.
    Bit(bool),
    /// The text of a string register or a literal.
    Text(String),
    /// The position of a position register or of the robot.
    Place(RobotPosition),
}

/// The values that an expression uses beside the memory.
#[derive(Debug, Clone, Copy)]
pub struct EvaluationContext<'a> {
    /// The time of the simulated program, in s.
    pub now: f64,
    /// The values of AR\[n\], from n = 1.
    pub arguments: &'a [Value],
    /// The position of the robot: in X Y Z W P R of its user frame, and by its joints.
    pub here: (RobotPosition, RobotPosition),
    /// The positions of the program.
    pub program: &'a fanuc_ls::Program,
}

/// The reason for which an expression cannot be computed.
pub(super) type Fault = String;

impl Memory {
    /// Evaluates an expression.
    ///
    /// # Errors
    /// If parts of the expression do not fit together, or are not simulated.
    pub fn value(
        &self,
        it: &Expression,
        tables: &Tables,
        around: &EvaluationContext<'_>,
    ) -> Result<Value, Fault> {
        Ok(match it {
            Expression::Number(number) => Value::Number(*number),
            Expression::Text(text) => Value::Text(text.clone()),
            Expression::On => Value::Bit(true),
            Expression::Off => Value::Bit(false),
            Expression::Rising | Expression::Falling => {
                return Err("edges, ON+ and OFF-, are not modelled".into());
            }
            Expression::CartesianPosition => Value::Place(around.here.0),
            Expression::JointPosition => Value::Place(around.here.1),
            Expression::Item(item) => self.read(item, tables, around)?,
            Expression::System(name) if name == "ERR_NUM" => {
                return Err("ERR_NUM is not modelled".into());
            }
            Expression::System(name) => Value::Number(self.system.get(name).copied().unwrap_or(0.0)),
            Expression::Not(inner) => Value::Bit(!self.bit(inner, tables, around)?),
            Expression::Negative(inner) => Value::Number(-self.number(inner, tables, around)?),
            Expression::Binary(operator, sides) => {
                let (left, right) = &**sides;
                let (left, right) = (self.value(left, tables, around)?, self.value(right, tables, around)?);
                combine(*operator, left, right)?
            }
            Expression::Call(function, values) => {
                let values = values.iter().map(|value| self.number(value, tables, around));
                Value::Number(computed(*function, &values.collect::<Result<Vec<_>, _>>()?)?)
            }
            Expression::Pallet(_) => return Err("pallets are not modelled".into()),
            Expression::Untaught => return Err("a value is not filled in".into()),
        })
    }

    /// Evaluates an expression as a number.
    ///
    /// # Errors
    /// If it is not a number.
    pub fn number(
        &self,
        it: &Expression,
        tables: &Tables,
        around: &EvaluationContext<'_>,
    ) -> Result<f64, Fault> {
        match self.value(it, tables, around)? {
            Value::Number(number) => Ok(number),
            Value::Bit(bit) => Ok(f64::from(u8::from(bit))),
            Value::Text(_) | Value::Place(_) => Err("a number is needed".into()),
        }
    }

    /// Evaluates an expression as a condition.
    ///
    /// # Errors
    /// If it is not a condition.
    pub fn bit(
        &self,
        it: &Expression,
        tables: &Tables,
        around: &EvaluationContext<'_>,
    ) -> Result<bool, Fault> {
        match self.value(it, tables, around)? {
            Value::Bit(bit) => Ok(bit),
            Value::Number(number) => Ok(number != 0.0),
            Value::Text(_) | Value::Place(_) => Err("a condition is needed".into()),
        }
    }

    /// Evaluates the number of an item.
    ///
    /// # Errors
    /// The register of the number has no value.
    pub fn index(
        &self,
        index: &Index,
        tables: &Tables,
        around: &EvaluationContext<'_>,
    ) -> Result<u32, Fault> {
        match index {
            Index::Number(number) => Ok(*number),
            Index::Item(item) => match self.read(item, tables, around)? {
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in its range")]
                Value::Number(number) if (1.0..=65_535.0).contains(&number) => Ok(number.round() as u32),
                Value::Number(number) => Err(format!("{number} is not an index")),
                other => Err(format!("{other:?} is not an index")),
            },
            Index::Untaught => Err("an index is not filled in".into()),
        }
    }

    /// Returns the value of an item.
    ///
    /// # Errors
    /// If the item does not exist, or is not simulated.
    pub fn read(&self, item: &Item, tables: &Tables, around: &EvaluationContext<'_>) -> Result<Value, Fault> {
        let n = self.index(&item.index, tables, around)?;
        if let Some(signal) = signal(item.kind, n) {
            let beyond = || self.beyond.get(&signal).copied().unwrap_or(0);
            let value = tables.signal(signal).unwrap_or_else(beyond);
            return Ok(match is_word(item.kind) {
                true => Value::Number(value.into()),
                false => Value::Bit(value != 0),
            });
        }
        Ok(match item.kind {
            ItemKind::Register => Value::Number(self.numbers.get(&n).copied().unwrap_or(0.0)),
            ItemKind::StringRegister => Value::Text(self.strings.get(&n).cloned().unwrap_or_default()),
            ItemKind::Marker => Value::Bit(self.markers.get(&n).copied().unwrap_or(false)),
            ItemKind::Timer => Value::Number(
                self.timers
                    .get(&n)
                    .map_or(0.0, |timer| timer.seconds + timer.since.map_or(0.0, |since| around.now - since)),
            ),
            ItemKind::Argument => {
                let index = usize::try_from(n).unwrap_or(0).checked_sub(1);
                let found = index.and_then(|index| around.arguments.get(index)).cloned();
                found.ok_or_else(|| format!("AR[{n}] was not given"))?
            }
            ItemKind::PositionRegister => {
                let place = self.positions.get(&n).copied().unwrap_or_default();
                match &item.element {
                    None => Value::Place(place),
                    Some(element) => {
                        let element = self.index(element, tables, around)?;
                        Value::Number(
                            place
                                .element(element)
                                .ok_or_else(|| format!("PR[{n},{element}] is not modelled"))?,
                        )
                    }
                }
            }
            ItemKind::Position => {
                let found = around.program.position(n);
                let group = found.and_then(|position| position.groups.first());
                let place = group.and_then(RobotPosition::of_group).ok_or_else(|| match group {
                    None => format!("/POS does not define P[{n}]"),
                    Some(group) if group.axes.iter().any(|axis| axis.name == AxisName::RX) => {
                        format!("P[{n}] has RX to RR: a tool that is fixed in the cell is not modelled")
                    }
                    Some(_) => format!("P[{n}] was never taught, or lacks an axis of the robot"),
                });
                Value::Place(place?)
            }
            kind => return Err(format!("{kind}[{n}] is not modelled as a value")),
        })
    }

    /// Gives an item a value.
    ///
    /// # Errors
    /// If the item does not take the value.
    pub fn write(
        &mut self,
        item: &Item,
        value: Value,
        tables: &mut Tables,
        around: &EvaluationContext<'_>,
    ) -> Result<(), Fault> {
        let n = self.index(&item.index, tables, around)?;
        let refused = |value: &Value| Err(format!("{}[{n}] does not take {value:?}", item.kind));
        if let Some(signal) = signal(item.kind, n) {
            let value = match &value {
                Value::Bit(bit) if !is_word(item.kind) => u16::from(*bit),
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in its range")]
                Value::Number(number) if is_word(item.kind) && (0.0..=65_535.0).contains(number) => {
                    number.round() as u16
                }
                value => return refused(value),
            };
            self.set_signal(signal, value, tables);
            return Ok(());
        }
        match (item.kind, value) {
            (ItemKind::Register, Value::Number(number)) => drop(self.numbers.insert(n, number)),
            (ItemKind::Register, Value::Bit(bit)) => drop(self.numbers.insert(n, f64::from(u8::from(bit)))),
            (ItemKind::StringRegister, Value::Text(text)) => drop(self.strings.insert(n, text)),
            (ItemKind::StringRegister, Value::Number(number)) => {
                self.strings.insert(n, number.to_string());
            }
            (ItemKind::Timer, Value::Number(seconds)) => {
                let timer = self.timers.entry(n).or_default();
                *timer = Timer { seconds, since: timer.since.map(|_| around.now) };
            }
            (ItemKind::Marker, Value::Bit(bit)) => drop(self.markers.insert(n, bit)),
            (ItemKind::PositionRegister, Value::Place(place)) if item.element.is_none() => {
                self.positions.insert(n, place);
            }
            (ItemKind::PositionRegister, Value::Number(number)) => {
                let Some(element) = &item.element else { return refused(&Value::Number(number)) };
                let element = self.index(element, tables, around)?;
                let place = self.positions.entry(n).or_default();
                *place.element_mut(element).ok_or_else(|| format!("PR[{n},{element}] is not modelled"))? =
                    number;
            }
            (ItemKind::UserFrame | ItemKind::UserTool, Value::Place(place)) => {
                let RobotPosition::Cartesian { xyzwpr, .. } = place else {
                    return Err("a frame is set from X Y Z W P R".into());
                };
                self.frames.insert((item.kind == ItemKind::UserTool, n), xyzwpr);
            }
            (_, value) => return refused(&value),
        }
        Ok(())
    }

    /// Gives a signal a value, 0 or 1 to a bit.
    pub(super) fn set_signal(&mut self, signal: Signal, value: u16, tables: &mut Tables) {
        if tables.set_signal(signal, value).is_none() {
            self.beyond.insert(signal, value);
        }
    }

    /// Starts, stops or resets a timer.
    pub fn time(&mut self, n: u32, action: fanuc_ls::TimerAction, now: f64) {
        let timer = self.timers.entry(n).or_default();
        match action {
            fanuc_ls::TimerAction::Start => timer.since = timer.since.or(Some(now)),
            fanuc_ls::TimerAction::Stop => {
                timer.seconds += timer.since.take().map_or(0.0, |since| now - since);
            }
            fanuc_ls::TimerAction::Reset => {
                timer.seconds = 0.0;
                timer.since = timer.since.map(|_| now);
            }
        }
    }
}

/// Returns the signal of an item, if it is one.
pub(super) fn signal(kind: ItemKind, n: u32) -> Option<Signal> {
    let n = u16::try_from(n).ok()?;
    let has_zero = matches!(kind, ItemKind::OperatorInput | ItemKind::OperatorOutput);
    if n == 0 && !has_zero {
        return None;
    }
    Some(match kind {
        ItemKind::Flag => Signal::Flag(n),
        ItemKind::DigitalInput => Signal::Di(n),
        ItemKind::DigitalOutput => Signal::Do(n),
        ItemKind::RobotInput => Signal::Ri(n),
        ItemKind::RobotOutput => Signal::Ro(n),
        ItemKind::GroupInput => Signal::Gi(n),
        ItemKind::GroupOutput => Signal::Go(n),
        ItemKind::AnalogInput => Signal::Ai(n),
        ItemKind::AnalogOutput => Signal::Ao(n),
        ItemKind::OperatorInput => Signal::Si(n),
        ItemKind::OperatorOutput => Signal::So(n),
        ItemKind::UserInput => Signal::Ui(n),
        ItemKind::UserOutput => Signal::Uo(n),
        _ => return None,
    })
}

pub(super) fn is_word(kind: ItemKind) -> bool {
    matches!(
        kind,
        ItemKind::GroupInput | ItemKind::GroupOutput | ItemKind::AnalogInput | ItemKind::AnalogOutput
    )
}

/// Computes a function of numbers; angles are in degrees.
fn computed(function: Function, values: &[f64]) -> Result<f64, Fault> {
    let (first, second) = (values.first().copied().unwrap_or_default(), values.get(1).copied());
    let value = match function {
        Function::Abs => first.abs(),
        Function::SquareRoot => first.sqrt(),
        Function::Sine => first.to_radians().sin(),
        Function::Cosine => first.to_radians().cos(),
        Function::Tangent => first.to_radians().tan(),
        Function::ArcSine => first.asin().to_degrees(),
        Function::ArcCosine => first.acos().to_degrees(),
        Function::ArcTangent => first.atan().to_degrees(),
        Function::ArcTangent2 => first.atan2(second.unwrap_or_default()).to_degrees(),
        Function::Exponential => first.exp(),
        Function::Logarithm => first.ln(),
        Function::Round => first.round(),
        Function::Truncate => first.trunc(),
        Function::StringLength | Function::FindString | Function::SubString => {
            return Err("functions of strings are not modelled".into());
        }
    };
    if value.is_finite() { Ok(value) } else { Err(format!("{function:?} of {first} has no value")) }
}

fn combine(operator: Operator, left: Value, right: Value) -> Result<Value, Fault> {
    use Operator as O;
    let text = |ordering: fn(&str, &str) -> bool, a: &str, b: &str| Ok(Value::Bit(ordering(a, b)));
    match (operator, &left, &right) {
        (O::And, Value::Bit(a), Value::Bit(b)) => return Ok(Value::Bit(*a && *b)),
        (O::Or, Value::Bit(a), Value::Bit(b)) => return Ok(Value::Bit(*a || *b)),
        (O::Equal, Value::Text(a), Value::Text(b)) => return text(|a, b| a == b, a, b),
        (O::Unequal, Value::Text(a), Value::Text(b)) => return text(|a, b| a != b, a, b),
        (O::Equal, Value::Bit(a), Value::Bit(b)) => return Ok(Value::Bit(a == b)),
        (O::Unequal, Value::Bit(a), Value::Bit(b)) => return Ok(Value::Bit(a != b)),
        (O::Add, Value::Text(a), b) => {
            let b = match b {
                Value::Text(b) => b.clone(),
                Value::Number(b) => b.to_string(),
                Value::Bit(_) | Value::Place(_) => return Err("a text and something else".into()),
            };
            return Ok(Value::Text(format!("{a}{b}")));
        }
        (O::Add | O::Subtract, Value::Place(a), Value::Place(b)) => {
            let sign = if operator == O::Add { 1.0 } else { -1.0 };
            return a
                .plus(b, sign)
                .map(Value::Place)
                .ok_or_else(|| "joints and X Y Z cannot be added".into());
        }
        _ => {}
    }
    let (Value::Number(a), Value::Number(b)) = (&left, &right) else {
        return Err(format!("{left:?} and {right:?} are incompatible"));
    };
    let (a, b) = (*a, *b);
    if matches!(operator, O::Divide | O::DivideWhole | O::Remainder) && b == 0.0 {
        return Err("a division by zero".into());
    }
    #[expect(clippy::float_cmp, reason = "as a controller compares its registers")]
    Ok(match operator {
        O::Equal => Value::Bit(a == b),
        O::Unequal => Value::Bit(a != b),
        O::Less => Value::Bit(a < b),
        O::LessOrEqual => Value::Bit(a <= b),
        O::Greater => Value::Bit(a > b),
        O::GreaterOrEqual => Value::Bit(a >= b),
        O::And => Value::Bit(a != 0.0 && b != 0.0),
        O::Or => Value::Bit(a != 0.0 || b != 0.0),
        O::Add => Value::Number(a + b),
        O::Subtract => Value::Number(a - b),
        O::Multiply => Value::Number(a * b),
        O::Divide => Value::Number(a / b),
        O::DivideWhole => Value::Number((a / b).trunc()),
        O::Remainder => Value::Number(a % b),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_count_in_degrees_and_have_a_value_or_say_so() {
        assert!((computed(Function::Sine, &[30.0]).unwrap_or_default() - 0.5).abs() < 1e-12);
        assert!((computed(Function::ArcTangent2, &[1.0, -1.0]).unwrap_or_default() - 135.0).abs() < 1e-9);
        assert_eq!(computed(Function::Truncate, &[-2.7]), Ok(-2.0));
        assert_eq!(computed(Function::SquareRoot, &[-1.0]), Err("SquareRoot of -1 has no value".into()));
        assert_eq!(computed(Function::SubString, &[]), Err("functions of strings are not modelled".into()));
    }
}
