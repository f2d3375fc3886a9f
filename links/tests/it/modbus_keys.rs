//! The keys of Modbus messages that no function has.

use cellwire_links::fanuc_hmi_modbus::unknown_key;
use fanuc_hmi_modbus::Side;
use serde_json::{Value, json};

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
    let exception = unknown(json!({"function": 3, "exception": 2, "registers": []}), Side::Server);
    let text = "unknown key registers: an exception of function 3 has transaction, unit, function, exception";
    assert_eq!(exception.as_deref(), Some(text));
    let write = json!({"function": 16, "address": 0, "value": 1});
    let error = unknown(write, Side::Client).unwrap();
    assert!(
        error.starts_with("unknown key value: a request of function 16 has ")
            && error.ends_with("address, values")
    );
    for (message, side) in [
        (json!({"transaction": 1, "unit": 1, "function": 22, "address": 0, "and": 1, "or": 2}), Side::Client),
        (json!({"unit": 1, "function": 3, "registers": [1]}), Side::Server),
        (json!({"unit": 1, "function": 3, "exception": 2}), Side::Server),
        (json!({"unit": 1, "function": 99, "data": [1]}), Side::Client),
        (json!({"unit": 1, "strange": 99}), Side::Client),
    ] {
        assert_eq!(unknown(message, side), None);
    }
}
