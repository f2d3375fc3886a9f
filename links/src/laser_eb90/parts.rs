use serde_json::Value;

use crate::explain::{Part, Parts, ReadMessage};

/// DLE: doubled in the payload.
const STUFFED: u8 = 0x90;

pub(super) fn parts(read: &ReadMessage<'_>) -> Vec<Part> {
    let mut parts = Parts::stuffed(read.bytes, 3, STUFFED);
    parts.take(3, "head", "LE-7");
    let items = read.message["items"].as_array().map(Vec::as_slice).unwrap_or_default();
    let items: Vec<(&String, usize)> = items
        .iter()
        .filter_map(Value::as_object)
        .flatten()
        .map(|(kind, values)| (kind, length(values)))
        .collect();
    let payload: usize = items.iter().map(|(kind, length)| 2 + length * size(kind)).sum();
    // Of a frame without a flag, as much less is before the tail.
    if read.bytes.get(3) == Some(&0xF0) && parts.left_stuffed() > payload {
        parts.take(1, "flag", "LE-8");
    }
    for (at, (kind, length)) in items.into_iter().enumerate() {
        parts.take(1, "tag", "LE-16");
        parts.take(1, "count", "LE-15");
        let name = format!("/items/{at}/{kind}");
        if kind == "char" {
            parts.take(length, name, "4.1");
        } else {
            parts.list(length, size(kind), &name, "4.1");
        }
    }
    parts.take(2, "tail", "LE-10");
    parts.end("checksum", "LE-13")
}

fn length(values: &Value) -> usize {
    match values {
        Value::String(text) => text.chars().count(),
        values => values.as_array().map_or(0, Vec::len),
    }
}

/// Returns the length of a value, in bytes.
fn size(kind: &str) -> usize {
    match kind {
        "f32" => 4,
        "i16" => 2,
        _ => 1,
    }
}
