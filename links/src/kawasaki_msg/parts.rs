use crate::explain::{Part, Parts, ReadMessage};

pub(super) fn parts(read: &ReadMessage<'_>) -> Vec<Part> {
    let mut parts = Parts::new(read.bytes);
    // As roles, which value is in which field is the plant's.
    let is_plain = read.message.get("name").is_some();
    let name = |plain: String, role: &str| if is_plain { plain } else { role.into() };
    parts.take(1, "start mark", "3");
    parts.until(b"$", name("/name".into(), "/role"), "KM-18");
    let head = read.bytes.iter().position(|byte| *byte == b'#').unwrap_or_default();
    let values = read.bytes.iter().take(head).filter(|byte| **byte == b'$').count();
    for header in 0..values.saturating_sub(1) {
        parts.take(1, "separator", "KM-13");
        parts.until(b"$", name(format!("/header/{header}"), "header field"), "KM-12");
    }
    parts.take(1, "separator", "KM-13");
    parts.until(b"#", "length", "KM-11");
    parts.take(1, "mark", "3");
    let mut field = 0;
    while parts.left() > 2 {
        parts.until(b"$#", name(format!("/fields/{field}"), "field"), "KM-18");
        if parts.peek() == Some(b'$') {
            parts.take(1, "separator", "KM-13");
        }
        field += 1;
    }
    parts.take(1, "mark", "3");
    parts.end("end mark", "3")
}
