//! The properties of characters that the source leaves open. The names of a plant's messages belong to its table; they are not
//! settings of the codec.

use kawasaki_msg::Dialect;
use serde_json::Value;

use super::rust::rust;
use crate::link::{DecidingMessage, OpenSettings};

pub(super) const OPEN: OpenSettings = OpenSettings {
    settings: &["charset"],
    beside: &[],
    guess: None,
    deciding: &[DecidingMessage {
        side: "pc",
        about: "a name or field with a letter beyond ASCII",
        message: r#"{"name":"Määrä","fields":["1"]}"#,
    }],
    reads_more: &[],
    rust: |given, _| rust(given),
    notes,
    ..OpenSettings::NOTHING
};

/// Returns the names that the default table of messages does not have.
fn notes(messages: &[(&'static str, Value)]) -> Vec<String> {
    let is_own = |name: &&str| Dialect::DEFAULT.entries().iter().all(|entry| entry.name != *name);
    let names = messages.iter().filter_map(|(_, message)| message["name"].as_str());
    let mut own: Vec<&str> = names.filter(is_own).collect();
    own.sort_unstable();
    own.dedup();
    let Some(first) = own.first() else { return Vec::new() };
    vec![format!(
        "{} names of messages are the plant's own, such as {first}: its ends need its table (--draft FILE)",
        own.len()
    )]
}
