//! The tables of a crate's page that are made: every field of its configurations from the code, and its costs from the last results
//! of `.ci/size` and of the bench `budgets`; and the figures of the first page, from the same counts.

use core::fmt::Write as _;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use cellwire_links::LINKS;
use serde::Deserialize;
use serde_json::Value;

const CONFIGURATIONS: &str = "<!-- Written by `cargo run -p reference -- write`. -->\n";
const COSTS: &str = "<!-- Costs, written by `cargo run -p reference -- write`. -->\n";
const END: &str = "<!-- End -->\n";

/// The crates with costs that are no links: the name, and the folder.
const OTHERS: [(&str, &str); 4] = [
    ("fanuc-ls", "fanuc-ls"),
    ("mmacell-task", "mmacell-task"),
    ("robot-session", "robot-session"),
    ("robot-work-queue", "work-queue"),
];

/// A row of `benches/results.json`: the instructions of one piece of work.
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

/// The page of each crate.
pub(crate) fn files(root: &Path, defaults: &str) -> Result<Vec<(PathBuf, String)>> {
    let defaults: Value = serde_json::from_str(defaults)?;
    let fields = defaults.get("fields").and_then(Value::as_array).context("no fields")?;
    let sizes = std::fs::read_to_string(root.join("testkit/reference/inputs/sizes.txt"))?;
    let counts = std::fs::read_to_string(root.join("benches/results.json"))?;
    let counts: Vec<Count> = serde_json::from_str(&counts).context("benches/results.json")?;
    let page = |(name, folder): (&str, &str)| {
        let path = root.join(folder).join("README.md");
        let mut page = std::fs::read_to_string(&path)?;
        let rows: Vec<&Value> = fields.iter().filter(|row| text(row, "link") == name).collect();
        if !rows.is_empty() {
            page = put(&page, CONFIGURATIONS, &table(&rows)).with_context(|| path.display().to_string())?;
        }
        page =
            put(&page, COSTS, &costs(name, &sizes, &counts)).with_context(|| path.display().to_string())?;
        Ok((path, page))
    };
    let pages = LINKS.iter().map(|link| (link.name, link.name)).chain(OTHERS).map(page);
    pages.collect()
}

/// A page with another table after this mark.
fn put(page: &str, begin: &str, table: &str) -> Result<String> {
    let (before, rest) = page.split_once(begin).with_context(|| format!("no {begin}"))?;
    let (_, after) = rest.split_once(END).with_context(|| format!("no {END}"))?;
    Ok(format!("{before}{begin}\n{table}\n{END}{after}"))
}

/// The bytes of each end, and the instructions of what an end does in normal operation.
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
        let (what, each) = (&row.what, row.each.replace("op", "time"));
        let _ = writeln!(instructions, "| {what} | {each} | {} |", row.instructions());
    }
    if !instructions.is_empty() {
        table += "| instructions | for each | |\n| --- | --- | ---: |\n";
        table += &instructions;
    }
    format!("{}\n", table.trim_end())
}

/// Whether a row of the counts is neither another crate's, nor a limit by hand, nor a line that is out of order.
fn is_own(what: &str) -> bool {
    !what.starts_with(['…', '–'])
        && !["random bytes", "noise", "one byte a push", "alone"].iter().any(|word| what.contains(word))
}

fn table(rows: &[&Value]) -> String {
    let mut table = String::from(
        "| field | default | unit and range | what it is for | source |\n| --- | --- | --- | --- | --- |\n",
    );
    let mut config = "";
    for row in rows {
        if config != text(row, "config") {
            config = text(row, "config");
            table += &format!("| **`{config}`** | | | | |\n");
        }
        let (unit, range) = (text(row, "unit"), text(row, "range"));
        let values = match unit {
            "bool" | "word" | "ns" | "list" | "object" | "code" => range.to_owned(),
            unit => format!("{unit}; {range}"),
        };
        let values = values.replace("null: never", "`Duration::MAX`: never").replace("null: ", "`None`: ");
        table += &format!(
            "| `{}` | {} | {values} | {} | {} |\n",
            text(row, "field"),
            default(row.get("default").unwrap_or(&Value::Null), unit),
            text(row, "about"),
            text(row, "source")
        );
    }
    table
}

/// A default as a reader expects it: a time with its unit, and what is a table of its own by the name of that.
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
