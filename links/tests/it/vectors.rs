//! The comparison of objects with those of the vectors, and their hex digits.

use cellwire_links::vectors::{includes, unhex};
use serde_json::json;

#[test]
fn an_error_object_may_say_more_than_the_vector() {
    let found = json!({"kind": "length", "expected": 4, "found": 5});
    assert!(includes(&found, &json!({"kind": "length"})));
    assert!(includes(&found, &json!({"kind": "length", "found": 5})));
    assert!(!includes(&found, &json!({"kind": "length", "found": 6})));
    assert!(!includes(&found, &json!({"kind": "length", "offset": 0})));
}

#[test]
fn hex_is_spaced_by_field() {
    assert_eq!(unhex("10 1002 a017").unwrap(), [0x10, 0x10, 0x02, 0xA0, 0x17]);
    assert_eq!(unhex("1").unwrap_err().to_string(), "an odd number of hex digits: 1");
    assert_eq!(unhex("1g").unwrap_err().to_string(), "not hex: 1g");
}
