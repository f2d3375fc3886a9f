//! Values as JSON.

use std::io::Write as _;

use serde::Serialize;
use serde_json::Value;

/// Converts a value that consists of numbers and names.
pub fn value(value: impl Serialize) -> Value {
    serde_json::to_value(value).unwrap_or_default()
}

/// Returns a value as JSON, in the form of [`write()`]; every value of the links consists of numbers, texts and names.
pub fn text(value: &impl Serialize) -> String {
    let mut out = Vec::new();
    match write(value, &mut out) {
        Ok(()) => String::from_utf8_lossy(&out).into_owned(),
        Err(_) => "null".into(),
    }
}

/// Appends a value as JSON in which every control character is escaped, also those of a peer's text: no terminal executes one.
///
/// # Errors
/// If the value cannot be JSON.
pub fn write(value: &impl Serialize, out: &mut Vec<u8>) -> serde_json::Result<()> {
    let begin = out.len();
    serde_json::to_writer(&mut *out, value)?;
    // JSON escapes the control characters below 20h. The others are 7Fh, and C2h with a second byte below A0h. Without an
    // early end, the loop examines many bytes at once.
    let line = out.get(begin..).unwrap_or_default();
    if line.iter().fold(false, |found, byte| found | (*byte == 0x7F) | (*byte == 0xC2)) {
        escape(begin, out);
    }
    Ok(())
}

/// Escapes the control characters of the JSON from `begin` on.
#[cold]
fn escape(begin: usize, out: &mut Vec<u8>) {
    let line = out.split_off(begin);
    for c in String::from_utf8_lossy(&line).chars() {
        if c.is_control() {
            let _ = write!(out, "\\u{:04x}", u32::from(c)); // into a Vec
        } else {
            out.extend_from_slice(c.encode_utf8(&mut [0; 4]).as_bytes());
        }
    }
}
