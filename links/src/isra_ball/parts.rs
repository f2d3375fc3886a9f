use crate::explain::{Part, Parts, ReadMessage, count};

pub(super) fn parts(read: &ReadMessage<'_>) -> Vec<Part> {
    let mut parts = Parts::new(read.bytes);
    parts.take(3, "header", "IB-5");
    if read.message.get("data").is_some() {
        parts.list(count(read.message, "data"), 1, "/data", "IB-13");
    } else {
        parts.take(1, "/sensor_type", "IB-10");
        parts.also("/sensor", "IB-10");
        parts.also("/status", "4.2");
        parts.list(3, 1, "/force", "4.2");
        parts.list(3, 1, "/moment", "4.2");
        parts.take(1, "/keys", "4.2");
    }
    parts.end("checksum", "IB-6")
}
