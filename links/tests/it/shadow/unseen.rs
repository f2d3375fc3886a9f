//! Faults that are not visible between the ends, and the reasons.

use core::time::Duration;

use serde_json::Value;

use super::faults::{Case, Fault, late};
use super::recorded::RecordedBody;

const AS_GOOD: &str = "another value is as good";
const NO_ANSWER: &str = "nothing answers it";
const CLOSED: &str = "the connection ends before an answer is due";
const ANY_TIME: &str = "nothing says when it is sent";
const FIRST: &str = "in the first exchange: what came before the tap may have been asked for or answered";
const NOTHING: &str = "nothing comes behind it that depends on it";
const NO_CHECKSUM: &str = "without a checksum the bytes are another message that is as good";
const HOLD: &str = "XON and XOFF may come at any time, and again";

/// The order of the columns in `counts.rs`.
pub(crate) const REASONS: [&str; 8] =
    [AS_GOOD, NO_ANSWER, CLOSED, ANY_TIME, FIRST, NOTHING, NO_CHECKSUM, HOLD];

/// Returns the reason why the fault cannot be seen; `None` if it must be seen.
pub(crate) fn unseen(case: &Case<'_>) -> Option<&'static str> {
    let asks = case.from == asker(case.link.name);
    let is_hold = matches!(&case.story.told[case.place].what, RecordedBody::Bytes(_, bytes) if bytes.iter().all(|byte| [0x11, 0x13].contains(byte)));
    match case.fault {
        _ if case.link.name == "val2-viewer" && is_hold => Some(HOLD),
        Fault::Delayed if asks && may_wait(case) => Some(ANY_TIME),
        Fault::Delayed if is_last(case) => Some(ANY_TIME),
        Fault::Dropped | Fault::Delayed if asks && !is_answered(case) => Some(NO_ANSWER),
        Fault::Dropped | Fault::Delayed if !asks && closes(case) => Some(CLOSED),
        Fault::Dropped if case.link.name == "val2-alter" && behind(case).next().is_none() => Some(NOTHING),
        Fault::Dropped | Fault::Repeated | Fault::Changed if is_first(case) => Some(FIRST),
        Fault::Changed if is_as_good(case) => Some(AS_GOOD),
        Fault::Changed if asks && !is_answered(case) => Some(NO_ANSWER),
        Fault::Changed if behind(case).next().is_none() && case.link.name != "laser-eb90" => Some(NOTHING),
        Fault::Corrupt if !has_checksum(case) => Some(NO_CHECKSUM),
        _ => None,
    }
}

/// Returns the end that requests, and waits for an answer.
fn asker(link: &str) -> &'static str {
    match link {
        "laser-eb90" | "isra-ball" => "host",
        "fanuc-hmi-modbus" => "client",
        "mmacell-proto" => "central",
        "val2-viewer" => "workstation",
        _ => "robot",
    }
}

/// Returns whether a request may come at any time: the controller of ALTER and the robot of Kawasaki have a cycle.
fn may_wait(case: &Case<'_>) -> bool {
    let is_start = case.message.as_ref().is_some_and(|message| message["kind"] == "start");
    !["val2-alter", "kawasaki-msg"].contains(&case.link.name) || is_start
}

/// Returns whether nothing follows the message.
fn is_last(case: &Case<'_>) -> bool {
    case.story.told.len() == case.place + 1
}

/// Returns the senders of the bytes after a message, until the connection changes.
fn behind<'a>(case: &'a Case<'_>) -> impl Iterator<Item = &'static str> + use<'a> {
    let behind = case.story.told.iter().skip(case.place + 1);
    behind.map_while(|told| match &told.what {
        RecordedBody::Bytes(from, _) => Some(*from),
        RecordedBody::Opened | RecordedBody::Closed => None,
    })
}

/// Returns whether the other end sends before this one sends again.
fn is_answered(case: &Case<'_>) -> bool {
    behind(case).next().is_some_and(|from| from != case.from)
}

/// Returns whether its connection ends before it is due.
fn closes(case: &Case<'_>) -> bool {
    let told = &case.story.told;
    let end = told.iter().skip(case.place + 1).find(|told| !matches!(told.what, RecordedBody::Bytes(..)));
    end.is_some_and(|end| end.at.saturating_sub(told[case.place].at) < late(case.link).min(MAX_WAIT))
}

/// The longest that any of these stories waits for an answer.
const MAX_WAIT: Duration = Duration::from_secs(60);

/// Returns whether no exchange of this connection was seen before the message, on a link on which an end may have worked
/// before.
fn is_first(case: &Case<'_>) -> bool {
    let before = case.story.told[..case.place].iter().rev();
    let before = before.take_while(|told| matches!(told.what, RecordedBody::Bytes(..)));
    let ends: Vec<&str> = before
        .filter_map(|told| match &told.what {
            RecordedBody::Bytes(from, _) => Some(*from),
            RecordedBody::Opened | RecordedBody::Closed => None,
        })
        .collect();
    let has_both = ends.contains(&case.from) && ends.iter().any(|end| *end != case.from);
    let is_serial = match case.link.name {
        "laser-eb90" => true,
        "fanuc-hmi-modbus" => case.story.config.get("framing").is_some_and(|framing| framing == "rtu"),
        _ => false,
    };
    is_serial && !has_both
}

/// Returns whether the bytes of this side have a checksum.
fn has_checksum(case: &Case<'_>) -> bool {
    match case.link.name {
        "kawasaki-msg" | "mmacell-proto" => false,
        "fanuc-hmi-modbus" => case.story.config.contains_key("framing"),
        "isra-ball" | "val2-viewer" => case.link.sides.contains(&case.from),
        _ => true,
    }
}

/// Returns whether neither the other end nor the following messages depend on the changed value.
fn is_as_good(case: &Case<'_>) -> bool {
    let (Some(message), Some(other)) = (&case.message, &case.other) else { return false };
    let path = difference(message, other).unwrap_or_default();
    let free: &[&str] = match (case.link.name, case.from) {
        // All but the word; and if the answer is an error code, the word too, since the code does not name it.
        ("laser-eb90", _) => {
            let is_code =
                |message: &Value| message["items"][0]["i16"][0].as_i64().is_some_and(|word| word < 0);
            let is_refused = case.story.told.get(case.place + 1).is_some_and(|told| match &told.what {
                RecordedBody::Bytes(from, bytes) => {
                    *from != case.from && bytes.get(6..8).is_some_and(|word| word[1] == 0xE0)
                }
                _ => false,
            });
            return path != "/items/0/i16/0" || (is_code(message) && is_code(other)) || is_refused;
        }
        ("fanuc-hmi-modbus", "client") => match message["function"].as_u64() {
            Some(1..=4) => &["address"],
            Some(15 | 16) => &["bits", "registers"],
            Some(23) => &["read_address", "write_address", "registers", "write_quantity", "address"],
            _ => &["data"],
        },
        ("fanuc-hmi-modbus", _) => &["registers", "bits", "exception", "data"],
        ("isra-ball", _) => &["force", "moment", "keys"],
        ("val2-viewer", _) => &["pose"],
        ("mmacell-proto", _) => &["axes", "camera", "gripper", "open", "error", "percent", "on"],
        ("val2-alter", "robot") => {
            &["data", "segment", "segment_status", "percent", "transform", "mode", "phase"]
        }
        ("val2-alter", _) => &["values", "exception"],
        _ => return case.link.name == "kawasaki-msg",
    };
    free.iter().any(|name| path.split('/').any(|part| part == *name))
}

/// Returns the path to the leaf that differs.
fn difference(a: &Value, b: &Value) -> Option<String> {
    match (a, b) {
        (Value::Object(a), Value::Object(b)) => {
            a.iter().find_map(|(name, a)| Some(format!("/{name}{}", difference(a, b.get(name)?)?)))
        }
        (Value::Array(a), Value::Array(b)) => a
            .iter()
            .zip(b)
            .enumerate()
            .find_map(|(place, (a, b))| Some(format!("/{place}{}", difference(a, b)?))),
        _ => (a != b).then(String::new),
    }
}
