//! `reference/states/<link>.json`: every cell of every machine, from the rows in testkit.

use anyhow::Result;
use testkit::links::TABLES;
use testkit::model::Cell;

use crate::json::{self, Object};

/// The crate of the operator's latch, which is no link, and has states alone.
pub(crate) const LATCH: &str = "cellwire-motion";

/// Every cell of a link.
pub(crate) fn table(link: &str) -> Vec<Cell> {
    let tables = TABLES.iter().copied().flatten().filter(|table| table.link == link);
    tables.flat_map(|table| (table.cells)()).collect()
}

/// The text of a link's file.
pub(crate) fn file(link: &str) -> Result<String> {
    let mut lines = Vec::new();
    for Cell { end, state, input, to, action } in table(link) {
        let object = Object::new().value("machine", end)?.value("state", &state)?.value("input", &input)?;
        let object = match &to {
            None => object.raw("unexpected", true),
            Some(to) => object.value("to", to)?,
        };
        lines.push(object.optional("actions", (!action.is_empty()).then_some(&action))?.end());
    }
    Ok(json::file("states.schema.json", &[("link", json::text(link)?)], "cells", &lines))
}
