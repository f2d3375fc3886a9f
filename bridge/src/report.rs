//! The messages between the bridge's threads.

use std::fmt;

use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value as Json};

use super::metric::NamedValue;
use crate::broker::BrokerEvent;

/// An input of the hub.
#[derive(Debug)]
pub enum Input {
    /// A report of the cell of this number.
    Cell(usize, Report),
    /// An event of the connection of this number.
    Broker(u64, BrokerEvent),
}

/// A report of a cell.
#[derive(Debug, PartialEq)]
pub struct Report {
    /// The time of the report, in milliseconds since 1970 UTC.
    pub at: u64,
    /// The contents of the report.
    pub body: ReportBody,
}

/// The contents of a report.
#[derive(Debug, PartialEq)]
pub enum ReportBody {
    /// Values of the cell's metrics.
    Values(Vec<NamedValue>),
    /// The event of a device that does not answer, as an object of JSON: it is not a record.
    Failed(String),
    /// The device reports implausible values: the cell's own metrics have no values.
    Bad(Vec<NamedValue>),
    /// The outcome of a command.
    Outcome {
        /// The id of the command.
        id: String,
        /// The outcome of the command.
        outcome: Outcome,
        /// The reason for the outcome; empty without one.
        detail: String,
    },
}

/// A command for a cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    /// The command's id. The sender chooses it and uses it once.
    pub id: String,
    /// The order to execute; the possible orders depend on the link.
    pub order: Map<String, Json>,
    /// The time after which the command is not begun, in milliseconds since 1970 UTC.
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

/// The outcome of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The command is in the store, and on its way to the device.
    Accepted,
    /// The device has executed the command, or has queued it if that is all that the link reports.
    Done,
    /// The command was not executed.
    Refused,
    /// Some of the command was executed, and the rest will not be.
    Partial,
    /// The outcome is unknown: the command may have been executed or not, but not twice.
    Unknown,
}

impl Outcome {
    /// Returns the name of the outcome in the metric.
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
