//! What bridges that share cells say to one another: JSON, on a topic of each.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::remembered::Entry;

/// What a bridge says.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Message {
    pub term: String,
    pub number: u64,
    #[serde(flatten)]
    pub what: What,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum What {
    /// That it lives.
    Alive(Alive),
    /// What became of a command.
    Command { cell: String, id: String, entry: Entry },
}

/// What a bridge that lives says of itself.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Alive {
    /// The cells that it offers to have, and whether it has them.
    pub cells: BTreeMap<String, bool>,
    /// The others that it has heard, and the terms that they had then.
    pub knows: BTreeMap<String, String>,
    /// The time of the latest command that it knows to have been given, in milliseconds since 1970 UTC.
    pub until: u64,
    /// It has no cell, and takes none before it says another term.
    pub ends: bool,
}

impl Alive {
    /// Whether the other bridges would do the same if they heard this in place of the other.
    pub(super) fn says_the_same(&self, other: &Self) -> bool {
        (&self.cells, &self.knows, self.ends) == (&other.cells, &other.knows, other.ends)
    }
}
