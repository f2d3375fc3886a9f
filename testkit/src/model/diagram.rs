//! Diagrams of the transitions that the model has visited.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::Path;

use super::machine::Edge;

/// Returns a state diagram of one end in Markdown, for the docs of its machine: only transitions that can happen are
/// included. A transition without a change or an action is omitted.
pub fn mermaid<'a>(edges: impl IntoIterator<Item = &'a Edge>, end: &str) -> String {
    let mut arrows = BTreeMap::<_, BTreeSet<String>>::new();
    let shown = |edge: &&Edge| edge.end == end && (edge.from != edge.to || does_something(edge));
    for edge in edges.into_iter().filter(shown) {
        let label = if does_something(edge) {
            format!("{} / {}", edge.input, edge.action)
        } else {
            edge.input.into()
        };
        arrows.entry((edge.from, edge.to)).or_default().insert(label);
    }
    let mut out = String::from("```mermaid\nstateDiagram-v2\n");
    for ((from, to), labels) in arrows {
        let labels: Vec<_> = labels.into_iter().collect();
        let _ = writeln!(out, "    {from} --> {to}: {}", labels.join("<br>"));
    }
    out + "```\n"
}

fn does_something(edge: &Edge) -> bool {
    !matches!(edge.action.as_str(), "" | "Nothing" | "None")
}

/// Compares a committed file with its expected content, or writes it.
///
/// # Errors
/// The file's; one that differs is `InvalidData`, with the command that writes it.
pub fn check_or_write(path: &Path, text: &str, write: bool) -> io::Result<()> {
    if write {
        path.parent().map_or(Ok(()), fs::create_dir_all)?;
        return fs::write(path, text);
    }
    let found = fs::read_to_string(path)
        .map_err(|error| io::Error::new(error.kind(), format!("{}: {error}", path.display())))?;
    if found == text {
        return Ok(());
    }
    let message =
        format!("{} is not what the model shows; write it with: cargo xtask model diagrams", path.display());
    Err(io::Error::new(io::ErrorKind::InvalidData, message))
}
