//! The table `share` of the site file.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::{Broker, Cell, check_name};
use cellwire_io::port::AnyPort;

/// The bridges that share cells.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShareSettings {
    /// The nodes of all sharing bridges, including this one.
    pub bridges: Vec<String>,
}

/// The name of a wrong setting, and the reason.
type BadSetting = (String, anyhow::Error);

/// Checks the shared cells, and the bridges that share them.
pub(super) fn check(
    share: Option<&ShareSettings>,
    broker: &Broker,
    cells: &BTreeMap<String, Cell>,
) -> Result<(), BadSetting> {
    let wrong = |name: &str, why: &str| Err((name.to_owned(), anyhow::anyhow!("{name}: {why}")));
    let mut shared = cells.iter().filter(|(_, cell)| cell.shared).peekable();
    let Some(ShareSettings { bridges }) = share else {
        return match shared.next() {
            Some((name, _)) => wrong(&format!("cell.{name}.shared"), "there is no table [share]"),
            None => Ok(()),
        };
    };
    if shared.peek().is_none() {
        return wrong("share", "no cell is shared: set shared = true for shared cells");
    }
    if !bridges.contains(&broker.node) || bridges.iter().all(|name| *name == broker.node) {
        return wrong(
            "share.bridges",
            "list the nodes of all bridges that share cells, including broker.node",
        );
    }
    if let Some(Err(error)) = bridges.iter().map(|name| check_name(name)).find(Result::is_err) {
        return wrong("share.bridges", &error.to_string());
    }
    if broker.address.all().len() > 1 {
        return wrong(
            "broker.address",
            "bridges that share cells must use one broker: give one address, that of the whole cluster",
        );
    }
    for (name, cell) in shared {
        if cell.address.as_deref().is_none_or(AnyPort::is_serial) {
            return wrong(
                &format!("cell.{name}.shared"),
                "a shared device needs HOST:PORT, not a serial port or listen",
            );
        }
    }
    Ok(())
}
