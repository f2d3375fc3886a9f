//! What the hall's file says of cells that bridges share.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::hall::{Broker, Cell, check_name};
use cellwire::io::port::AnyPort;

/// The bridges that share cells.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Share {
    /// The nodes of all of them, also of this one.
    pub bridges: Vec<String>,
}

/// What is wrong, and where.
type Wrong = (String, anyhow::Error);

/// Checks what is shared, and with whom.
pub(crate) fn check(
    share: Option<&Share>,
    broker: &Broker,
    cells: &BTreeMap<String, Cell>,
) -> Result<(), Wrong> {
    let wrong = |name: &str, why: &str| Err((name.to_owned(), anyhow::anyhow!("{name}: {why}")));
    let mut shared = cells.iter().filter(|(_, cell)| cell.shared).peekable();
    let Some(Share { bridges }) = share else {
        return match shared.next() {
            Some((name, _)) => {
                wrong(&format!("cell.{name}.shared"), "there is no [share] that says with whom")
            }
            None => Ok(()),
        };
    };
    if shared.peek().is_none() {
        return wrong("share", "no cell is shared: give shared = true to those that are");
    }
    if !bridges.contains(&broker.node) || bridges.iter().all(|name| *name == broker.node) {
        return wrong(
            "share.bridges",
            "give the nodes of all bridges that share cells: broker.node and others",
        );
    }
    if let Some(Err(error)) = bridges.iter().map(|name| check_name(name)).find(Result::is_err) {
        return wrong("share.bridges", &error.to_string());
    }
    if broker.address.all().len() > 1 {
        return wrong(
            "broker.address",
            "bridges that share cells have to be at one broker: give one address, of a cluster the one of all its nodes",
        );
    }
    for (name, cell) in shared {
        if cell.address.as_deref().is_none_or(AnyPort::is_serial) {
            return wrong(
                &format!("cell.{name}.shared"),
                "another bridge reaches its device at the same HOST:PORT only: no serial port, and no listen",
            );
        }
    }
    Ok(())
}
