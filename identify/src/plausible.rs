//! Whether the numbers and texts of a message make sense, which decides between readings that the bytes do not decide.

use serde_json::Value;

/// For a number that is, or against one that is not, a position, an angle or a speed: wrong bytes are one of these once in
/// nine times.
const NUMBER: f64 = 1.5;
/// Against an implausible number: the bytes of a round number in the wrong order are one of these.
const NO_NUMBER: f64 = -8.0;
/// For a letter.
const LETTER: f64 = 0.5;
/// Against a character that no text has.
const NO_TEXT: f64 = -2.0;

/// Returns the sense that a message makes; 0 if nothing in it shows any.
pub(super) fn plausible(message: &Value) -> f64 {
    match message {
        Value::Number(number) if number.is_f64() => {
            let size = number.as_f64().map_or(0.0, f64::abs);
            match size {
                _ if size == 0.0 || (1e-3..1e5).contains(&size) => NUMBER,
                _ if !(1e-30..1e30).contains(&size) => NO_NUMBER,
                _ => -NUMBER,
            }
        }
        Value::String(text) => text.chars().map(letter).sum(),
        Value::Array(values) => values.iter().map(plausible).sum(),
        Value::Object(fields) => fields.values().map(plausible).sum(),
        _ => 0.0,
    }
}

fn letter(c: char) -> f64 {
    match c {
        'a'..='z' | 'A'..='Z' | ' ' => LETTER,
        '\n' | '\r' | '\t' | '!'..='~' => 0.0,
        c if c.is_alphabetic() => 0.0,
        _ => NO_TEXT,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_sense_of_numbers_and_texts() {
        for (message, sense) in [
            (json!([0.0, 0.001, -99_999.0]), 3.0 * NUMBER),
            (json!([1e5, 0.000_9, -1e-30]), -3.0 * NUMBER),
            (json!([1e30, -1e-31, 1e38]), 3.0 * NO_NUMBER),
            // A whole number may be anything.
            (json!([0, 1, 1_000_000, null, true]), 0.0),
            (json!({"a": "Az z", "b": ["\n\r\t!~09", "ä"]}), 4.0 * LETTER),
            (json!("\u{1}\u{7F}\u{A0}"), 3.0 * NO_TEXT),
        ] {
            assert!((plausible(&message) - sense).abs() < 1e-9, "{message}: {}", plausible(&message));
        }
    }
}
