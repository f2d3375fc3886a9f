//! The keys of message objects, for errors that name an unknown one.

use fanuc_hmi_modbus::{Side, function};
use serde_json::Value;

/// The keys that every message may have.
const ALL: [&str; 3] = ["transaction", "unit", "function"];

/// Returns an error text that names the first key that messages of the object's function do not have, and those that they have. `None`
/// if every key is known, or the function is missing.
pub fn unknown_key(message: &Value, side: Side) -> Option<String> {
    let message = message.as_object()?;
    let code = u8::try_from(message.get("function")?.as_u64()?).ok()?;
    let (what, keys): (&str, &[&str]) = match side {
        _ if message.contains_key("exception") => ("an exception", &["exception"]),
        Side::Client => ("a request", requested(code)),
        Side::Server => ("a reply", replied(code)),
    };
    let known = || ALL.iter().chain(keys);
    let unknown = message.keys().find(|key| !known().any(|known| known == key))?;
    let known: Vec<&str> = known().copied().collect();
    Some(format!("unknown key {unknown}: {what} of function {code} has {}", known.join(", ")))
}

fn requested(code: u8) -> &'static [&'static str] {
    match code {
        function::READ_COILS
        | function::READ_DISCRETE_INPUTS
        | function::READ_HOLDING_REGISTERS
        | function::READ_INPUT_REGISTERS => &["address", "quantity"],
        function::WRITE_COIL | function::WRITE_REGISTER => &["address", "value"],
        function::WRITE_COILS | function::WRITE_REGISTERS => &["address", "values"],
        function::MASK_WRITE_REGISTER => &["address", "and", "or"],
        function::READ_WRITE_REGISTERS => &["address", "quantity", "write_address", "values"],
        _ => &["data"],
    }
}

fn replied(code: u8) -> &'static [&'static str] {
    match code {
        function::READ_COILS | function::READ_DISCRETE_INPUTS => &["bits"],
        function::READ_HOLDING_REGISTERS
        | function::READ_INPUT_REGISTERS
        | function::READ_WRITE_REGISTERS => &["registers"],
        function::WRITE_COILS | function::WRITE_REGISTERS => &["address", "quantity"],
        function::WRITE_COIL | function::WRITE_REGISTER | function::MASK_WRITE_REGISTER => requested(code),
        _ => &["data"],
    }
}
