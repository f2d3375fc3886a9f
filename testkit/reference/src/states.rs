//! `reference/states/<link>.json`: every cell of every machine, from the rows in testkit.

use anyhow::{Context, Result, bail, ensure};
use serde_json::{Map, Value};
use testkit::links::TABLES;
use testkit::model::Cell;

use crate::json::{self, Object};

/// The crate of the operator's latch, which is not a link and has only states.
pub(crate) const LATCH: &str = "cellwire-motion";

/// Returns every cell of a link.
pub(crate) fn table(link: &str) -> Vec<Cell> {
    let tables = TABLES.iter().copied().flatten().filter(|table| table.link == link);
    tables.flat_map(|table| (table.cells)()).collect()
}

/// Returns the text of a link's file.
pub(crate) fn file(link: &str) -> Result<String> {
    let mut lines = Vec::new();
    for Cell { end, state, input, to, action } in table(link) {
        let object = Object::new().value("machine", end)?.value("state", &state)?.value("input", &input)?;
        let object = match &to {
            None => object.raw("unexpected", true),
            Some(to) => object.value("to", to)?,
        };
        let action = if action.is_empty() { None } else { Some(shown(&action)?) };
        lines.push(object.optional("actions", action.as_ref())?.end());
    }
    Ok(json::file("states.schema.json", &[("link", json::text(link)?)], "cells", &lines))
}

/// Converts the `Debug` text of an action to JSON: a string, or an object whose only key is the name.
fn shown(debug: &str) -> Result<Value> {
    let mut rest = debug;
    let value = read(&mut rest).with_context(|| debug.to_owned())?;
    ensure!(rest.is_empty(), "{debug}: {rest} is left");
    Ok(value)
}

fn read(rest: &mut &str) -> Result<Value> {
    if take(rest, "[") {
        return Ok(list(rest, "]")?.into());
    }
    if take(rest, "(") {
        return Ok(list(rest, ")")?.into());
    }
    if take(rest, "\"") {
        let (text, after) = rest.split_once('"').context("a text has no end")?;
        *rest = after;
        return Ok(text.into());
    }
    let name = word(rest);
    if let Ok(number) = name.parse::<u64>() {
        return Ok(number.into());
    }
    match name {
        "None" => return Ok(Value::Null),
        "true" => return Ok(true.into()),
        "false" => return Ok(false.into()),
        "" => bail!("no word at {rest}"),
        _ if name.starts_with(|c: char| c.is_ascii_digit()) => bail!("{name} is no number"),
        _ => {}
    }
    let says = if take(rest, " { ") {
        fields(rest)?
    } else if take(rest, "(") {
        let mut values = list(rest, ")")?;
        if values.len() == 1 { values.remove(0) } else { values.into() }
    } else {
        return Ok(snake(name).into());
    };
    Ok(if name == "Some" { says } else { Map::from_iter([(snake(name), says)]).into() })
}

fn fields(rest: &mut &str) -> Result<Value> {
    let mut fields = Map::new();
    loop {
        let name = word(rest).to_owned();
        ensure!(take(rest, ": "), "no value of {name}");
        fields.insert(name, read(rest)?);
        if take(rest, " }") {
            return Ok(fields.into());
        }
        ensure!(take(rest, ", "), "no end at {rest}");
    }
}

fn list(rest: &mut &str, end: &str) -> Result<Vec<Value>> {
    let mut values = Vec::new();
    while !take(rest, end) {
        ensure!(values.is_empty() || take(rest, ", "), "no end at {rest}");
        values.push(read(rest)?);
    }
    Ok(values)
}

fn word<'a>(rest: &mut &'a str) -> &'a str {
    let length = rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(rest.len());
    let (word, after) = rest.split_at_checked(length).unwrap_or((rest, ""));
    *rest = after;
    word
}

fn take(rest: &mut &str, mark: &str) -> bool {
    let after = rest.strip_prefix(mark);
    *rest = after.unwrap_or(rest);
    after.is_some()
}

/// Converts a name to snake case: `NotSent` as `not_sent`.
fn snake(name: &str) -> String {
    let mut text = String::new();
    for c in name.chars() {
        if c.is_ascii_uppercase() && !text.is_empty() {
            text.push('_');
        }
        text.push(c.to_ascii_lowercase());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_rust_shows_is_shown_as_json() -> Result<()> {
        let is = |debug: &str, expected: Value| -> Result<()> {
            assert_eq!(shown(debug)?, expected, "{debug}");
            Ok(())
        };
        is("NoReply", json!("no_reply"))?;
        is("Stray { late: Some(0), name: \"Off\" }", json!({"stray": {"late": 0, "name": "Off"}}))?;
        is("Start(None, Some((A, B(true))))", json!({"start": [null, ["a", {"b": true}]]}))?;
        is("TimedOut([0, 1])", json!({"timed_out": [0, 1]}))?;
        is("Reset { lost: [], not_sent: [] }", json!({"reset": {"lost": [], "not_sent": []}}))?;
        assert!(shown("Rest)").is_err() && shown("Wait { for: 10ms }").is_err());
        Ok(())
    }
}
