//! Checks the contents of a frame.

use core::time::Duration;

use laser_eb90::timing::transmission_time;
use laser_eb90::{Class, HostConfig, Words};
use serde_json::Value;

use super::HOST;
use crate::shadow::Report;

/// Checks the contents of a host's frame.
pub(super) fn judge(message: &Value, words: &Words, batch: u8, report: &mut Report<'_>) {
    let Some(word) = first_word(message) else {
        return report.rule(HOST, "LE-19", "a frame that does not begin with a word");
    };
    let all: Vec<u16> = items(message).filter_map(single).collect();
    match words.class(word) {
        None => report.rule(HOST, "LE-102", format!("{word:04X}h is not a command word")),
        Some(Class::Interpreted) => {
            let other = all.iter().find(|word| words.class(**word) != Some(Class::Interpreted));
            if let Some(other) = other {
                let text = format!("{other:04X}h after the interpreted instruction {word:04X}h");
                report.rule(HOST, "LE-23", text);
            }
            let most = usize::from(batch);
            if all.len() > most {
                report.rule(HOST, "LE-22", format!("{} instructions in a frame", all.len()));
            }
        }
        Some(_) => {
            if let Some(other) = all.iter().skip(1).find(|word| words.class(**word).is_some()) {
                let text = format!("the command word {other:04X}h among the parameters of {word:04X}h");
                report.rule(HOST, "LE-24", text);
            }
        }
    }
}

/// Returns the time of an answer on the line, without stuffed bytes.
pub(super) fn line(message: &Value, host: &HostConfig) -> Duration {
    let is_short = items(message).count() == 1;
    transmission_time(if is_short { 13 } else { 2 * laser_eb90::MAX_PAYLOAD }, host.baud)
}

pub(super) fn items(message: &Value) -> impl Iterator<Item = &Value> {
    message.get("items").and_then(Value::as_array).into_iter().flatten()
}

/// Returns the value of an item that is a single short (LE-18).
fn single(item: &Value) -> Option<u16> {
    match item.get("i16")?.as_array()?.as_slice() {
        [value] => Some(i16::try_from(value.as_i64()?).ok()?.cast_unsigned()),
        _ => None,
    }
}

pub(super) fn first_word(message: &Value) -> Option<u16> {
    items(message).next().and_then(single)
}
