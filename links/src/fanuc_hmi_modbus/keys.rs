//! The keys of message objects, for errors that name an unknown one.

use fanuc_hmi_modbus::{FrameObject, Side};
use serde_json::Value;

/// The keys that every message may have.
const ALL: [&str; 3] = ["transaction", "unit", "function"];

/// Returns an error text that names the first key that messages of the object's function do not have, and those that they
/// have. `None` if every key is known, or the function is missing.
pub fn unknown_key(message: &Value, side: Side) -> Option<String> {
    let message = message.as_object()?;
    let code = u8::try_from(message.get("function")?.as_u64()?).ok()?;
    let what = match side {
        _ if message.contains_key("exception") => "an exception",
        Side::Client => "a request",
        Side::Server => "a reply",
    };
    let mut known: Vec<String> = ALL.map(Into::into).into();
    if message.contains_key("exception") {
        known.push("exception".into());
    } else {
        known.extend(FrameObject::keys(code, side).map(|key| key.to_string()));
    }
    let unknown = message.keys().find(|key| !known.contains(key))?;
    Some(format!("unknown key {unknown}: {what} of function {code} has {}", known.join(", ")))
}
