use crate::explain::{Part, Parts, ReadMessage};

pub(super) fn parts(read: &ReadMessage<'_>) -> Vec<Part> {
    let mut parts = Parts::new(read.bytes);
    parts.take(1, "letter", "XX-1");
    if read.message.get("get").is_some() {
        parts.until(b"\n", "/get/register", "XX-3");
    } else {
        parts.until(b"=", "/value/register", "XX-3");
        parts.take(1, "separator", "XX-2");
        parts.until(b"\n", "/value/value", "XX-3");
    }
    parts.end("end", "XX-1")
}
