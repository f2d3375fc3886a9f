//! Whether the numbers and texts of a message make sense: what decides between readings that the bytes do not decide.

use serde_json::Value;

/// For a number that is, or against one that is not, a position, an angle or a speed: wrong bytes are one of these once in nine times.
const NUMBER: f64 = 1.5;
/// Against an implausible number: the bytes of a round number in the wrong order are one of these.
const NO_NUMBER: f64 = -8.0;
/// For a letter.
const LETTER: f64 = 0.5;
/// Against a character that no text has.
const NO_TEXT: f64 = -2.0;

/// How much sense a message makes; 0 where nothing in it tells.
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
