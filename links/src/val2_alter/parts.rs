use crate::explain::{Part, Parts, ReadMessage, count};

const DLE: u8 = 0x10;
const STX: u8 = 0x02;

pub(super) fn parts(read: &ReadMessage<'_>) -> Vec<Part> {
    let mark = read.bytes.iter().position(|byte| *byte == STX).map_or(0, |stx| stx + 1);
    let mut parts = Parts::stuffed(read.bytes, mark, DLE);
    parts.take(mark, "start mark", "AL-5");
    let message = read.message;
    match message["kind"].as_str().unwrap_or_default() {
        "start" => {
            control(&mut parts, read, &["/kind", "/error", "/marked"], "AL-15");
            parts.take(1, "/mode", "4.7");
            parts.list(count(message, "data"), 2, "/data", "AL-14");
        }
        "motion" => {
            control(&mut parts, read, &["/kind", "/phase", "/error"], "AL-19");
            parts.take(1, "/segment_status", "4.6");
            parts.take(2, "/segment", "4.2");
            parts.take(2, "/percent", "AL-17");
            parts.list(count(message, "transform"), 2, "/transform", "AL-18");
        }
        "end" => {
            control(&mut parts, read, &["/kind", "/error"], "AL-20");
            let end = 2 + 1 + usize::from(read.bytes.ends_with(&[DLE, DLE]));
            parts.take(parts.left().saturating_sub(end), "ignored", "AL-20");
        }
        "start_reply" => parts.take(1, "/reply", "4.4"),
        _ => {
            parts.take(1, "/exception", "4.6");
            parts.take(1, "select", "AL-23");
            let values = message["values"].as_array().map(Vec::as_slice).unwrap_or_default();
            for (axis, _) in values.iter().enumerate().filter(|(_, value)| !value.is_null()) {
                parts.take(2, format!("/values/{axis}"), "4.5");
            }
        }
    }
    parts.take(2, "end mark", "AL-5");
    parts.end("checksum", "AL-7")
}

/// Takes the control byte, which has those of these values that the message contains; `error` is the clause of the error code.
fn control(parts: &mut Parts<'_>, read: &ReadMessage<'_>, names: &[&str], error: &'static str) {
    let mut there = names.iter().filter(|name| read.message.pointer(name).is_some());
    if let Some(first) = there.next() {
        parts.take(1, *first, "4");
    }
    for name in there {
        parts.also(*name, if *name == "/error" { error } else { "4" });
    }
}
