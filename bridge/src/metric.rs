//! The metrics of a cell: each metric that it may ever report has a name and a kind from its birth on.

use std::time::{SystemTime, UNIX_EPOCH};

use super::payload::{Kind, Value};

/// A metric that a cell has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Definition {
    /// The name of the metric; folders are separated by a slash.
    pub name: &'static str,
    /// The kind of the metric's values.
    pub kind: Kind,
}

/// A value of a metric, by its name.
pub type NamedValue = (&'static str, Value);

/// The number of a record: each record of a cell has one more than the previous one, even after a restart.
pub const NUMBER: &str = "Record/Number";
/// The store that numbers the records: another one begins at 1 again.
pub const STORE: &str = "Record/Store";
/// Whether the link to the device is connected.
pub const CONNECTED: &str = "Link/Connected";
/// An event: an object of JSON.
pub const EVENT: &str = "Event";
/// A command, which is written to the cell: an object of JSON.
pub const REQUEST: &str = "Command/Request";
/// The id of the command that an outcome belongs to.
pub const COMMAND: &str = "Command/Id";
/// The outcome of the command.
pub const OUTCOME: &str = "Command/Outcome";
/// The reason for the outcome.
pub const DETAIL: &str = "Command/Detail";

/// The metrics of every cell.
pub const COMMON: [Definition; 8] = [
    define(NUMBER, Kind::Int64),
    define(STORE, Kind::String),
    define(CONNECTED, Kind::Boolean),
    define(EVENT, Kind::String),
    define(REQUEST, Kind::String),
    define(COMMAND, Kind::String),
    define(OUTCOME, Kind::String),
    define(DETAIL, Kind::String),
];

/// Makes a definition.
pub const fn define(name: &'static str, kind: Kind) -> Definition {
    Definition { name, kind }
}

/// Returns the time now, in milliseconds since 1970 UTC.
pub fn now() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_millis()).unwrap_or(u64::MAX)
}

/// Makes the value of a whole number.
pub fn whole(number: impl Into<i64>) -> Value {
    // Two's complement, as Sparkplug has it.
    Value::Long(number.into().cast_unsigned())
}

/// Makes the value of a text.
pub fn text(text: impl Into<String>) -> Value {
    Value::String(text.into())
}
