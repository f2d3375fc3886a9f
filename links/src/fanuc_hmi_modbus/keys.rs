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

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn an_unknown_key_is_named_with_the_keys_of_its_function() {
        let unknown = |message: Value, side| unknown_key(&message, side);
        let read = json!({"unit": 1, "function": 3, "adress": 0, "quantity": 1});
        assert_eq!(
            unknown(read, Side::Client).as_deref(),
            Some(
                "unknown key adress: a request of function 3 has transaction, unit, function, address, quantity"
            )
        );
        let write = json!({"function": 16, "address": 0, "value": 1});
        let error = unknown(write, Side::Client).unwrap();
        assert!(
            error.starts_with("unknown key value: a request of function 16 has ")
                && error.ends_with("address, values")
        );
        for (message, side) in [
            (
                json!({"transaction": 1, "unit": 1, "function": 22, "address": 0, "and": 1, "or": 2}),
                Side::Client,
            ),
            (json!({"unit": 1, "function": 3, "registers": [1]}), Side::Server),
            (json!({"unit": 1, "function": 3, "exception": 2}), Side::Server),
            (json!({"unit": 1, "function": 99, "data": [1]}), Side::Client),
            (json!({"unit": 1, "strange": 99}), Side::Client),
        ] {
            assert_eq!(unknown(message, side), None);
        }
    }
}
