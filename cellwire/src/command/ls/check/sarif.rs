//! Findings as SARIF 2.1.0 (OASIS), the format in which editors and code hosts read the findings of checkers.

use fanuc_ls::Level;
use serde_json::{Value, json};

use super::file::File;
use cellwire_ls_server::{code, uri};

pub(super) fn document(results: Vec<Value>) -> Value {
    json!({
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{
            "tool": {"driver": {"name": "cellwire ls check", "version": env!("CARGO_PKG_VERSION")}},
            "columnKind": "unicodeCodePoints",
            "results": results,
        }],
    })
}

pub(super) fn results(file: &File<'_>) -> impl Iterator<Item = Value> {
    let uri = uri(file.path);
    file.problems().map(move |(problem, (line, column))| {
        let level = match problem.level() {
            Level::Error => "error",
            Level::Warning => "warning",
            Level::Hint => "note",
        };
        json!({
            "ruleId": code(&problem).replace(' ', "-"),
            "level": level,
            "message": {"text": format!("{problem}: {}", problem.advice())},
            "locations": [{"physicalLocation": {
                "artifactLocation": {"uri": uri},
                "region": {"startLine": line, "startColumn": column},
            }}],
        })
    })
}
