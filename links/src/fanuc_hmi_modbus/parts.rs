use serde_json::Value;

use crate::explain::{Part, Parts, ReadMessage, count};

/// The fields of the telemetry block: the number of values in a list (0 for a field that is not a list), and the bytes of each.
const TELEMETRY: &[(&str, usize, usize)] = &[
    ("life_counter", 0, 4),
    ("override", 0, 2),
    ("position", 3, 4),
    ("wpr", 3, 4),
    ("quaternion", 4, 4),
    ("velocity", 3, 4),
    ("quaternion_rate", 4, 4),
];

pub(super) fn parts(read: &ReadMessage<'_>) -> Vec<Part> {
    let (mut parts, message) = (Parts::new(read.bytes), read.message);
    let crc = if message.get("transaction").is_some() {
        parts.take(2, "/transaction", "FM-69");
        parts.take(2, "protocol", "FM-69");
        parts.take(2, "length", "FM-69");
        0
    } else {
        2
    };
    parts.take(1, "/unit", "FM-69");
    parts.take(1, "/function", "4.1");
    if message.get("exception").is_some() {
        parts.take(1, "/exception", "FM-70");
    } else if message.get("data").is_some() {
        parts.list(parts.left().saturating_sub(crc), 1, "/data", "4.1");
    } else {
        let is_request = read.side == "client";
        data(&mut parts, message, is_request);
    }
    parts.take(parts.left().saturating_sub(crc), "rest", "FM-11");
    parts.end("crc", "FM-9")
}

/// Takes the bytes after the function code, in their sequence.
fn data(parts: &mut Parts<'_>, message: &Value, is_request: bool) {
    if message.get("subfunction").is_some() {
        parts.take(2, "/subfunction", "FM-96");
        parts.list(count(message, "values"), 2, "/values", "FM-96");
        return;
    }
    match (message["function"].as_u64(), is_request) {
        (Some(7 | 11 | 12 | 17), true) => return,
        (Some(7), false) => return parts.take(1, "/status", "FM-103"),
        (Some(11 | 12), false) => return events(parts, message),
        (Some(17), false) => {
            parts.take(1, "byte count", "FM-13");
            return parts.list(count(message, "id"), 1, "/id", "FM-96");
        }
        (Some(20 | 21), _) => return files(parts, message),
        (Some(24), false) => {
            parts.take(2, "byte count", "FM-105");
            parts.take(2, "count of registers", "FM-105");
            return parts.list(count(message, "registers"), 2, "/registers", "FM-7");
        }
        (Some(24), true) => return parts.take(2, "/address", "FM-11"),
        _ => {}
    }
    if message.get("category").is_some() {
        identification(parts, message, is_request);
        return;
    }
    if !is_request && (message.get("bits").is_some() || message.get("address").is_none()) {
        parts.take(1, "byte count", "FM-13");
        bits(parts, "/bits", count(message, "bits"));
        parts.list(count(message, "registers"), 2, "/registers", "FM-7");
        if message.get("telemetry").is_some() {
            telemetry(parts);
        }
        return;
    }
    parts.take(2, "/address", "FM-11");
    match message["function"].as_u64() {
        Some(5 | 6) => parts.take(2, "/value", "4.1"),
        Some(22) => {
            parts.take(2, "/and", "FM-14");
            parts.take(2, "/or", "FM-14");
        }
        _ => {
            let name = if message.get("quantity").is_some() { "/quantity" } else { "quantity" };
            parts.take(2, name, "4.1");
        }
    }
    if message.get("write_address").is_some() {
        parts.take(2, "/write_address", "FM-15");
        parts.take(2, "write quantity", "4.1");
    }
    if message.get("values").is_some() {
        parts.take(1, "byte count", "FM-12");
        if message["function"] == 15 {
            bits(parts, "/values", count(message, "values"));
        } else {
            parts.list(count(message, "values"), 2, "/values", "FM-7");
        }
    }
}

/// Takes the bytes after the code of a reply of function 11 or 12.
fn events(parts: &mut Parts<'_>, message: &Value) {
    let is_log = message.get("log").is_some();
    if is_log {
        parts.take(1, "byte count", "FM-13");
    }
    parts.take(2, "/status", "FM-103");
    parts.take(2, "/events", "FM-103");
    if is_log {
        parts.take(2, "/messages", "FM-103");
        parts.list(count(message, "log"), 1, "/log", "FM-103");
    }
}

/// Takes the bytes after the code of function 20 or 21.
fn files(parts: &mut Parts<'_>, message: &Value) {
    parts.take(1, "byte count", "FM-104");
    for index in 0..count(message, "contents") {
        parts.take(1, "length", "FM-104");
        parts.take(1, "reference type", "FM-104");
        parts.list(count(message, &format!("contents/{index}")), 2, &format!("/contents/{index}"), "FM-7");
    }
    for key in ["ranges", "records"] {
        for index in 0..count(message, key) {
            let run = format!("/{key}/{index}");
            parts.take(1, "reference type", "FM-104");
            parts.take(2, format!("{run}/file"), "FM-104");
            parts.take(2, format!("{run}/record"), "FM-104");
            let quantity = if key == "ranges" { format!("{run}/quantity") } else { "quantity".into() };
            parts.take(2, quantity, "FM-104");
            parts.list(count(message, &format!("{key}/{index}/values")), 2, &format!("{run}/values"), "FM-7");
        }
    }
}

/// Takes the bytes after the code of function 43.
fn identification(parts: &mut Parts<'_>, message: &Value, is_request: bool) {
    parts.take(1, "MEI type", "FM-97");
    parts.take(1, "/category", "FM-97");
    if is_request {
        parts.take(1, "/object", "FM-97");
        return;
    }
    for name in ["/conformity", "/more", "/next", "count of objects"] {
        parts.take(1, name, "FM-97");
    }
    for index in 0..count(message, "objects") {
        let object = format!("/objects/{index}");
        let text = message.pointer(&format!("{object}/text")).and_then(Value::as_str).unwrap_or_default();
        parts.take(1, format!("{object}/id"), "FM-97");
        parts.take(1, "length", "FM-97");
        parts.take(text.chars().count(), format!("{object}/text"), "FM-97");
    }
}

/// Bits, eight to a byte.
fn bits(parts: &mut Parts<'_>, name: &str, bits: usize) {
    for bit in 0..bits {
        let name = format!("{name}/{bit}");
        if bit.is_multiple_of(8) { parts.take(1, name, "FM-8") } else { parts.also(name, "FM-8") }
    }
}

fn telemetry(parts: &mut Parts<'_>) {
    for &(name, count, size) in TELEMETRY {
        let name = format!("/telemetry/{name}");
        if count == 0 { parts.take(size, name, "FM-71") } else { parts.list(count, size, &name, "FM-71") }
    }
}
