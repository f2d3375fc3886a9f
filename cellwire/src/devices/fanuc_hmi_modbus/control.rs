//! The commands of `--control` to the simulated controller: registers and signals.

use cellwire_sim::fanuc::{FanucController, Tables, Write};
use fanuc_hmi_modbus::{Signal, Table};
use serde::Deserialize;
use serde_json::{Value, json};

use super::signal;
use crate::devices::control::{Command, Fields, OwnCommands, fields};

/// Most values of a `get`.
const MAX_VALUES: u16 = 1000;

/// Values of the tables, by signal or by address.
pub(super) fn own() -> OwnCommands<FanucController> {
    const SET: &str = "the `value` of a `signal` such as DI[1], or `values` of a `table` (discrete_inputs, coils, input_registers or holding_registers, the default) from PDU `address` on; 0 and 1, or false and true, for bits";
    OwnCommands {
        commands: &[
            Command {
                name: "set",
                about: SET,
                examples: &[
                    r#"{"do":"set","signal":"DI[1]","value":1}"#,
                    r#"{"do":"set","table":"holding_registers","address":200,"values":[7,8]}"#,
                ],
            },
            Command {
                name: "get",
                about: "the value of a `signal`, or `count` values (default 1) of a `table` from PDU `address` on",
                examples: &[
                    r#"{"do":"get","signal":"R[201]"}"#,
                    r#"{"do":"get","table":"holding_registers","address":200,"count":2}"#,
                ],
            },
        ],
        execute: |fanuc, args| {
            if args.name == "get" {
                let Get { signal, table, address, count } = args.read()?;
                let (table, address) = place(fanuc, signal.as_deref(), table, address)?;
                let count = count.unwrap_or(1);
                if count > MAX_VALUES || signal.is_some() && count != 1 {
                    return Err("`count` is 0 to 1000, and 1 for a signal".into());
                }
                let values = fanuc.controller().values(table, address, count);
                let values = values.ok_or_else(|| outside(table))?;
                return Ok(match (signal, values.as_slice()) {
                    (Some(_), [value]) => fields([("value", (*value).into())]),
                    _ => fields([("values", json!(values))]),
                });
            }
            let Set { signal, table, address, value, values } = args.read()?;
            let (table, address) = place(fanuc, signal.as_deref(), table, address)?;
            let values = match (value, values) {
                (Some(value), None) => vec![value],
                (None, Some(values)) if signal.is_none() => values,
                _ => return Err("give `value`, or `values` with an address".into()),
            };
            let values = values.into_iter().map(|value| word(table, value)).collect::<Result<Vec<_>, _>>()?;
            fanuc.controller().set_values(table, address, &values).ok_or_else(|| outside(table))?;
            Ok(Fields::new())
        },
        show: Box::new(show),
    }
}

/// Returns a write as JSON.
pub(super) fn show(write: &Write) -> Value {
    match write {
        Write::Coils(address, values) => {
            json!({"table": Table::Coils, "address": address, "values": values})
        }
        Write::Registers(address, values) => {
            json!({"table": Table::HoldingRegisters, "address": address, "values": values})
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Get {
    signal: Option<String>,
    table: Option<Table>,
    address: Option<u16>,
    count: Option<u16>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Set {
    signal: Option<String>,
    table: Option<Table>,
    address: Option<u16>,
    value: Option<Value>,
    values: Option<Vec<Value>>,
}

/// Returns the table and the address of a request.
fn place(
    fanuc: &FanucController,
    signal: Option<&str>,
    table: Option<Table>,
    address: Option<u16>,
) -> Result<(Table, u16), String> {
    match (signal.map(|name| (name, signal::parse(name))), table, address) {
        (Some((name, Some(Signal::R(number)))), None, None) => {
            let register = fanuc.controller().register(number);
            let register = register.ok_or_else(|| {
                format!("no assignment shows {name} as a whole number of 16 bits: use the `address` of its assignment")
            })?;
            Ok((Table::HoldingRegisters, register))
        }
        (Some((name, signal)), None, None) => {
            let known = signal.and_then(Signal::place);
            known.ok_or_else(|| format!("there is no signal {name}; a signal is {}", signal::NAMES))
        }
        (None, table, Some(address)) => Ok((table.unwrap_or(Table::HoldingRegisters), address)),
        _ => Err("give `signal`, or `address` and `table`".into()),
    }
}

/// Reads a value of a table.
fn word(table: Table, value: Value) -> Result<u16, String> {
    let is_bit = matches!(table, Table::DiscreteInputs | Table::Coils);
    let word = match value {
        Value::Bool(on) if is_bit => Some(u16::from(on)),
        // A negative number of 16 bits is read as one by its user.
        Value::Number(number) => number.as_i64().and_then(|number| {
            i16::try_from(number).map(i16::cast_unsigned).or_else(|_| u16::try_from(number)).ok()
        }),
        _ => None,
    };
    match word.filter(|word| !is_bit || *word < 2) {
        Some(word) => Ok(word),
        None if is_bit => Err("a bit is 0, 1, false or true".into()),
        None => Err("a register is -32768 to 65535".into()),
    }
}

fn outside(table: Table) -> String {
    let (name, last) = (json!(table), Tables::len(table).saturating_sub(1));
    format!("the addresses of {} are 0 to {last}", name.as_str().unwrap_or_default())
}
