//! The pages whose tables are made: every field of each link's configurations from the code, and the costs of each crate
//! from the last results of `.ci/size` and of the benches `budgets` and `calls`.

use core::fmt::Write as _;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use cellwire_links::LINKS;
use serde::Deserialize;
use serde_json::Value;

const BEGIN: &str = "<!-- Written by `cargo run -p reference -- write`. -->\n";
const END: &str = "<!-- End -->\n";

/// The crates with costs that are not links.
const OTHERS: [&str; 4] = ["fanuc-ls", "mmacell-task", "robot-session", "robot-work-queue"];

/// A row of a file in `benches/results`: the instructions of one piece of work.
#[derive(Deserialize)]
struct Count {
    link: String,
    what: String,
    /// `op`, `job` or `byte`.
    each: String,
    measured: f64,
}

impl Count {
    fn instructions(&self) -> String {
        if self.measured < 20.0 { format!("{:.2}", self.measured) } else { format!("{:.0}", self.measured) }
    }
}

/// Returns the page of the settings, and that of the costs.
pub(crate) fn files(root: &Path, defaults: &str) -> Result<Vec<(PathBuf, String)>> {
    let defaults: Value = serde_json::from_str(defaults)?;
    let fields = defaults.get("fields").and_then(Value::as_array).context("no fields")?;
    let sizes = std::fs::read_to_string(root.join("testkit/reference/inputs/sizes.txt"))?;
    let mut counts: Vec<Count> = Vec::new();
    for file in ["benches/results/budgets.json", "benches/results/calls.json"] {
        let rows = std::fs::read_to_string(root.join(file))?;
        counts.extend(serde_json::from_str::<Vec<Count>>(&rows).context(file)?);
    }
    let settings = |name: &str| {
        let rows: Vec<&Value> = fields.iter().filter(|row| text(row, "link") == name).collect();
        table(&rows)
    };
    let links = || LINKS.iter().map(|link| link.name);
    let page = |name: &str, sections: String| {
        let path = root.join("docs").join(name);
        let page = std::fs::read_to_string(&path)?;
        let page = put(&page, &sections).with_context(|| path.display().to_string())?;
        anyhow::Ok((path, page))
    };
    let section = |name: &str, table: String| format!("\n## {name}\n\n{table}");
    Ok(vec![
        page("settings.md", links().chain(["fanuc-ls"]).map(|name| section(name, settings(name))).collect())?,
        page(
            "costs.md",
            links().chain(OTHERS).map(|name| section(name, costs(name, &sizes, &counts))).collect(),
        )?,
    ])
}

/// Returns a page with these sections between its marks.
fn put(page: &str, sections: &str) -> Result<String> {
    let (before, rest) = page.split_once(BEGIN).with_context(|| format!("no {BEGIN}"))?;
    let (_, after) = rest.split_once(END).with_context(|| format!("no {END}"))?;
    Ok(format!("{before}{BEGIN}{sections}\n{END}{after}"))
}

/// Returns the bytes of each end, and the instructions of an end's work in normal operation.
fn costs(name: &str, sizes: &str, counts: &[Count]) -> String {
    let mut table = String::new();
    let ends: BTreeMap<&str, (&str, &str)> = sizes
        .lines()
        .filter_map(|line| match line.split_whitespace().collect::<Vec<_>>()[..] {
            [end, ram, code] => Some((end.strip_prefix(name)?.strip_prefix('-')?, (ram, code))),
            _ => None,
        })
        .collect();
    if !ends.is_empty() {
        table += "| end | bytes of RAM | bytes of code |\n| --- | ---: | ---: |\n";
        for (end, (ram, code)) in ends {
            let _ = writeln!(table, "| {} | {ram} | {code} |", end.replace('-', ", "));
        }
        table += "\n";
    }
    let mut instructions = String::new();
    for row in counts.iter().filter(|row| row.link == name && is_own(&row.what)) {
        let each = if row.each == "op" { String::new() } else { format!("; per {}", row.each) };
        let _ = writeln!(instructions, "| {}{each} | {} |", row.what, row.instructions());
    }
    if !instructions.is_empty() {
        table += "| work | instructions |\n| --- | ---: |\n";
        table += &instructions;
    }
    format!("{}\n", table.trim_end())
}

/// Returns whether a row of the counts is an end's own: not another crate's, not a limit by hand, and not a corrupt line.
fn is_own(what: &str) -> bool {
    !what.starts_with(['…', '–'])
        && !["random bytes", "noise", "one byte a push", "alone"].iter().any(|word| what.contains(word))
}

/// Returns the fields of a link's configurations. A row that an earlier configuration has too is only named.
fn table(rows: &[&Value]) -> String {
    let mut table =
        String::from("| field | default (unit; values) | meaning (source) |\n| --- | --- | --- |\n");
    let mut shown: Vec<&Value> = Vec::new();
    for config in rows.chunk_by(|row, next| text(row, "config") == text(next, "config")) {
        let (again, new): (Vec<&Value>, Vec<&Value>) =
            config.iter().partition(|row| shown.iter().any(|other| is_same(row, other)));
        let again: Vec<_> = again.iter().map(|row| format!("`{}`", text(row, "field"))).collect();
        let again = if again.is_empty() { String::new() } else { format!(" as above: {}", again.join(", ")) };
        table += &format!("| **`{}`** | |{again} |\n", config.first().map_or("", |row| text(row, "config")));
        for row in &new {
            let unit = text(row, "unit");
            let default = default(row.get("default").unwrap_or(&Value::Null), unit);
            let source = text(row, "source");
            table += &format!(
                "| `{}` | {default}{} | {}{} |\n",
                text(row, "field"),
                in_brackets(&values(unit, text(row, "range"))),
                text(row, "about"),
                in_brackets(if source == "ours" { "" } else { source }),
            );
        }
        shown.extend(new);
    }
    table
}

/// Returns whether two rows differ only in their configuration.
fn is_same(row: &Value, other: &Value) -> bool {
    ["field", "default", "unit", "range", "about", "source"].iter().all(|key| row.get(key) == other.get(key))
}

/// Returns the unit and the values of a field; none for a time or a boolean without a limit, which the page describes at its
/// head.
fn values(unit: &str, range: &str) -> String {
    let range = match unit {
        "ns" => range.replace("null: never", "").trim_end_matches("; ").replace("null: ", "`None`: "),
        _ => range.replace("null: ", "`None`: "),
    };
    match unit {
        "ns" if range == "from 0" => String::new(),
        "bool" => String::new(),
        "word" | "ns" | "list" | "object" | "code" => range,
        unit => format!("{unit}; {range}"),
    }
}

fn in_brackets(text: &str) -> String {
    if text.is_empty() { String::new() } else { format!(" ({text})") }
}

/// Returns a default in a readable form: a time with its unit, and a table of its own by its name.
fn default(value: &Value, unit: &str) -> String {
    match (value, unit) {
        (Value::Null, _) => "`None`".to_owned(),
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
