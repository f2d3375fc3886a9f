use crate::explain::{Part, Parts, ReadMessage, count};

pub(super) fn parts(read: &ReadMessage<'_>) -> Vec<Part> {
    let mut parts = Parts::new(read.bytes);
    parts.take(6, "head", "3");
    parts.until(b",", "/count", "VV-10");
    for word in 0..count(read.message, "pose") {
        parts.take(1, "comma", "3");
        parts.until(b",*", format!("/pose/{word}"), "4");
    }
    parts.take(1, "star", "3");
    parts.take(2, "checksum", "VV-6");
    parts.end("end", "VV-11")
}
