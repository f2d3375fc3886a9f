//! The tables of a crate's page that are made from the code: every field of its configurations.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde_json::Value;

const BEGIN: &str = "<!-- Written by `cargo run -p reference -- write`. -->\n";
const END: &str = "<!-- End -->\n";

/// The page of each crate that has a configuration.
pub(crate) fn files(root: &Path, defaults: &str) -> Result<Vec<(PathBuf, String)>> {
    let defaults: Value = serde_json::from_str(defaults)?;
    let rows = defaults.get("fields").and_then(Value::as_array).context("no fields")?;
    crate::LINKS
        .iter()
        .filter_map(|&link| {
            let rows: Vec<&Value> = rows.iter().filter(|row| text(row, "link") == link).collect();
            (!rows.is_empty()).then(|| page(&root.join(link).join("README.md"), &rows))
        })
        .collect()
}

fn page(path: &Path, rows: &[&Value]) -> Result<(PathBuf, String)> {
    let page = std::fs::read_to_string(path)?;
    let (before, rest) = page.split_once(BEGIN).with_context(|| format!("{}: no {BEGIN}", path.display()))?;
    let (_, after) = rest.split_once(END).with_context(|| format!("{}: no {END}", path.display()))?;
    Ok((path.to_owned(), format!("{before}{BEGIN}\n{}\n{END}{after}", table(rows))))
}

fn table(rows: &[&Value]) -> String {
    let mut table =
        String::from("| field | default | unit and range | source |\n| --- | --- | --- | --- |\n");
    let mut config = "";
    for row in rows {
        if config != text(row, "config") {
            config = text(row, "config");
            table += &format!("| **`{config}`** | | | |\n");
        }
        let (unit, range) = (text(row, "unit"), text(row, "range"));
        let about = match unit {
            "bool" | "word" | "object" | "table" => range.to_owned(),
            "ns" => range.to_owned(),
            unit => format!("{unit}; {range}"),
        };
        let about = about.replace("null: ", "none: ");
        table += &format!(
            "| `{}` | {} | {about} | {} |\n",
            text(row, "field"),
            default(row.get("default").unwrap_or(&Value::Null), unit),
            text(row, "source")
        );
    }
    table
}

/// A default as a reader expects it: a time with its unit, and what is a table of its own by the name of that.
fn default(value: &Value, unit: &str) -> String {
    match (value, unit) {
        (Value::Null, _) => "none".to_owned(),
        (Value::Number(ns), "ns") => time(ns.as_u64().unwrap_or_default()),
        (Value::Object(object), _) if object.values().all(Value::is_number) => {
            let fields: Vec<_> = object.iter().map(|(name, value)| format!("{name} {value}")).collect();
            fields.join(", ")
        }
        (Value::Object(_), _) => "its type's".to_owned(),
        (Value::String(word), _) => word.clone(),
        (value, _) => value.to_string().replace(',', ", "),
    }
}

fn time(ns: u64) -> String {
    match ns {
        0 => "0".to_owned(),
        ns if ns % 1_000_000_000 == 0 => format!("{} s", ns / 1_000_000_000),
        ns if ns % 1_000_000 == 0 => format!("{} ms", ns / 1_000_000),
        ns => format!("{} µs", ns / 1000),
    }
}

fn text<'a>(row: &'a Value, key: &str) -> &'a str {
    row.get(key).and_then(Value::as_str).unwrap_or_default()
}
