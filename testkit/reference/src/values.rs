//! `values` of `reference/vectors/<link>.json`: the meaning of addresses, registers and words.

use anyhow::{Context, Result, bail};
use cellwire_motion::{Observation, Tracker};
use fanuc_hmi_modbus::typed::Number;
use fanuc_hmi_modbus::{Assignment, Multiply, Signal, Table, TelemetryBlock, WordOrder, assignment, text};
use serde::Deserialize;
use serde_json::{Value, json};
use val2_alter::Scale;

use crate::json::Object;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Inputs {
    id: u32,
    comment: String,
    given: Value,
    clauses: Vec<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum GivenValue {
    Signal(Signal),
    Place { table: Table, address: u16 },
    Read { number: Number, registers: Vec<u16> },
    Write { number: Number, value: f64 },
    ReadText { registers: Vec<u16> },
    WriteText { text: String, registers: usize },
    ReadBlock { order: WordOrder, registers: Vec<u16> },
    WriteBlock { order: WordOrder, block: TelemetryBlock },
    Assign(Vec<Slot>),
    Track(Vec<TelemetryBlock>),
    Word(Amount),
    NearestWord(Amount),
}

/// The amount by which a word of ALTER moves; `null` is not a number (NaN).
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Amount {
    Mm(Option<f64>),
    Degrees(Option<f64>),
}

/// A slot of `$SNPX_ASG`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Slot {
    address: u16,
    size: u16,
    var_name: String,
    multiply: f32,
}

/// Returns a line of the file.
pub(crate) fn line(vector: &Inputs) -> Result<String> {
    let given = serde_json::from_value(vector.given.clone()).with_context(|| vector.given.to_string())?;
    let object = Object::new()
        .value("id", &vector.id)?
        .value("comment", &vector.comment)?
        .value("given", &vector.given)?;
    let object = match gives(given)? {
        Ok(gives) => object.value("gives", &gives)?,
        Err(error) => object.value("error", &error)?,
    };
    Ok(object.value("clauses", &vector.clauses)?.end())
}

/// Computes the value, or the object of the error.
fn gives(given: GivenValue) -> Result<Result<Value, Value>> {
    Ok(Ok(match given {
        GivenValue::Signal(signal) => match signal.place() {
            Some((table, address)) => json!({"table": table, "address": address}),
            None => Value::Null,
        },
        GivenValue::Place { table, address } => json!(Signal::at(table, address)),
        GivenValue::Read { number, registers } => json!(number.read(two(&registers)?)),
        GivenValue::Write { number, value } => match number.write(value) {
            Ok(words) => json!(words.get(..usize::from(number.kind.registers()))),
            Err(error) => {
                return Ok(Err(json!({"kind": "number", "least": error.least, "most": error.most})));
            }
        },
        GivenValue::ReadText { registers } => {
            let mut bytes = vec![0; 2 * registers.len()];
            let length = text::read(&registers, &mut bytes);
            bytes.truncate(length);
            json!(String::from_utf8(bytes)?)
        }
        GivenValue::WriteText { text, registers } => {
            let mut words = vec![0; registers];
            match text::write(text.as_bytes(), &mut words) {
                Ok(()) => json!(words),
                Err(error) => return Ok(Err(json!(error))),
            }
        }
        GivenValue::ReadBlock { order, registers } => {
            let registers = registers.first_chunk().context("a block has 37 registers")?;
            json!(TelemetryBlock::from_registers(registers, order))
        }
        GivenValue::WriteBlock { order, block } => json!(block.to_registers(order).as_slice()),
        GivenValue::Assign(slots) => {
            let mut assignments = Vec::new();
            for Slot { address, size, var_name, multiply } in &slots {
                match Multiply::new(*multiply) {
                    Ok(multiply) => {
                        assignments.push(Assignment { address: *address, size: *size, var_name, multiply })
                    }
                    Err(error) => return Ok(Err(json!(error))),
                }
            }
            if let Err(error) = assignment::check(&assignments) {
                return Ok(Err(json!(error)));
            }
            let ranges = assignments.iter().map(Assignment::pdu_range);
            json!(ranges.map(|range| [range.start, range.end - 1]).collect::<Vec<_>>())
        }
        GivenValue::Track(blocks) => {
            let mut tracker = Tracker::new();
            let mut all = Vec::new();
            for block in &blocks {
                all.push(match tracker.push(block) {
                    Observation::First => json!("first"),
                    Observation::Repeated => json!("repeated"),
                    Observation::Restarted => json!("restarted"),
                    Observation::Sample(sample) => json!({
                        "time": u64::try_from(sample.time.as_nanos())?,
                        "missed": sample.missed,
                        "orientation": sample.orientation.to_array(),
                        "velocity": sample.velocity,
                        "quaternion_rate": sample.quaternion_rate,
                    }),
                    _ => bail!("an observation without a name"),
                });
            }
            json!(all)
        }
        GivenValue::Word(amount) => {
            let word = match amount {
                Amount::Mm(mm) => Scale::PUMA_562.translation(mm.unwrap_or(f64::NAN)),
                Amount::Degrees(degrees) => Scale::PUMA_562.rotation(degrees.unwrap_or(f64::NAN)),
            };
            match word {
                Ok(word) => json!(word),
                Err(error) => return Ok(Err(json!(error))),
            }
        }
        GivenValue::NearestWord(Amount::Mm(mm)) => {
            json!(Scale::PUMA_562.translation_saturating(mm.unwrap_or(f64::NAN)))
        }
        GivenValue::NearestWord(Amount::Degrees(degrees)) => {
            json!(Scale::PUMA_562.rotation_saturating(degrees.unwrap_or(f64::NAN)))
        }
    }))
}

fn two(registers: &[u16]) -> Result<[u16; 2]> {
    Ok(match registers {
        [one] => [*one, 0],
        [one, two] => [*one, *two],
        _ => bail!("a number is in one register or in two"),
    })
}
