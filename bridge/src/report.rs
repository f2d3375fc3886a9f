//! What the threads of the bridge say to one another.

use std::fmt;

use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value as Json};

use super::metric::Named;
use crate::broker::Happened;

/// What the hub takes.
#[derive(Debug)]
pub enum Input {
    /// A report of the cell of this number.
    Cell(usize, Report),
    /// Something has happened on the connection of this number.
    Broker(u64, Happened),
}

/// What a cell reports.
#[derive(Debug, PartialEq)]
pub struct Report {
    /// When, in milliseconds since 1970 UTC.
    pub at: u64,
    /// What.
    pub what: What,
}

/// What a cell reports.
#[derive(Debug, PartialEq)]
pub enum What {
    /// Values of its metrics.
    Values(Vec<Named>),
    /// The event of a device that does not answer, as an object of JSON: it is no record.
    Failed(String),
    /// What the device reports cannot be: its own metrics have no values.
    Bad(Vec<Named>),
    /// What became of a command, and why.
    Outcome {
        /// The command.
        id: String,
        /// What became of it.
        outcome: Outcome,
        /// Why, or nothing.
        detail: String,
    },
}

/// A command for a cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    /// Who orders it chooses this, and never uses it again.
    pub id: String,
    /// What is to be done; what can be depends on the link.
    pub order: Map<String, Json>,
    /// Later it is not begun; in milliseconds since 1970 UTC.
    pub until: u64,
}

/// A JSON object in which no key is given twice.
#[derive(Debug)]
pub struct Order(pub Map<String, Json>);

impl<'de> Deserialize<'de> for Order {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Keys;
        impl<'de> Visitor<'de> for Keys {
            type Value = Order;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a JSON object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut given: A) -> Result<Order, A::Error> {
                let mut order = Map::new();
                while let Some((key, value)) = given.next_entry::<String, Json>()? {
                    if order.contains_key(&key) {
                        return Err(A::Error::custom(format!("{key:?} is given twice")));
                    }
                    order.insert(key, value);
                }
                Ok(Order(order))
            }
        }
        deserializer.deserialize_map(Keys)
    }
}

/// What became of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// It is kept in the store, and on its way to the device.
    Accepted,
    /// The device has executed it, or has queued it where that is all that the link reports.
    Done,
    /// It was not executed.
    Refused,
    /// Some of it was executed, and the rest will not be.
    Partial,
    /// Unknown: it may have been executed or not, but not twice.
    Unknown,
}

impl Outcome {
    /// As it is in the metric.
    pub fn name(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::Done => "done",
            Self::Refused => "refused",
            Self::Partial => "partial",
            Self::Unknown => "unknown",
        }
    }
}
