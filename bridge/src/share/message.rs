//! The messages of bridges that share cells: JSON, on topics of each bridge.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::commands::CommandReport;

/// A message of a bridge.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Message {
    pub term: String,
    pub number: u64,
    #[serde(flatten)]
    pub what: ShareBody,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum ShareBody {
    /// The bridge runs.
    Alive(BridgeState),
    /// The outcome of a command that is not in the ledger of this bridge.
    Command(CommandReport),
    /// A page of the ledger, which the broker stores.
    Page(Page),
}

/// The state of a bridge that runs.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct BridgeState {
    /// The identity of the bridge's store.
    pub store: String,
    /// The cells that the bridge offers to have, and whether it has them.
    pub cells: BTreeMap<String, bool>,
    /// The other bridges whose messages this one has received, and their terms at that time.
    pub knows: BTreeMap<String, String>,
    /// The other bridges whose messages this one has received, but not their ledgers: they publish these again.
    pub lacks: BTreeSet<String>,
    /// The time of the latest command that the bridge knows to have been given, in milliseconds since 1970 UTC.
    pub until: u64,
    /// Whether the bridge has no cell, and takes none before it announces another term.
    pub ends: bool,
}

impl BridgeState {
    /// Returns whether the other bridges would act in the same way if they received this state in place of the other.
    pub(super) fn says_the_same(&self, other: &Self) -> bool {
        (&self.store, &self.cells, &self.knows, &self.lacks, self.ends)
            == (&other.store, &other.cells, &other.knows, &other.lacks, other.ends)
    }
}

/// A page of a ledger.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Page {
    /// The number of the page.
    pub page: u64,
    /// The number of the first page, if this page is the last one.
    pub first: Option<u64>,
    /// The time of the latest command that the bridge knows to have been given, in milliseconds since 1970 UTC.
    pub until: u64,
    /// The commands on the page.
    pub commands: Vec<CommandReport>,
}
