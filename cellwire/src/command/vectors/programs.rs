//! The vectors of fanuc-ls: texts of programs, and of parts of them.

use std::collections::BTreeMap;

use anyhow::{Context, Result, bail, ensure};
use fanuc_ls::{CommentRule, Program, Rules};
use serde::Deserialize;
use serde_json::Value;

use super::report;

#[derive(Deserialize)]
struct File {
    parts: BTreeMap<String, Part>,
    vectors: Vec<Vector>,
}

/// The text around a part, and the list of the program that contains the part alone.
#[derive(Deserialize)]
struct Part {
    list: String,
    before: String,
    behind: String,
}

#[derive(Deserialize)]
struct Vector {
    id: u32,
    comment: String,
    part: Option<String>,
    #[serde(default)]
    options: Options,
    text: String,
    message: Option<Value>,
    written: Option<String>,
    refused: Option<Value>,
    error: Option<Value>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Options {
    name_limit: Option<usize>,
    comment: Option<String>,
}

/// Returns true when every vector agrees.
pub(super) fn check_file(name: &str, text: &str) -> Result<bool> {
    let file: File = serde_json::from_str(text)?;
    report(name, file.vectors.iter().map(|v| (v.id, v.comment.as_str(), check(&file, v))))
}

fn check(file: &File, vector: &Vector) -> Result<()> {
    let part = match &vector.part {
        Some(part) => Some(file.parts.get(part).with_context(|| format!("there is no part {part}"))?),
        None => None,
    };
    let whole =
        |text: &str| part.map_or(text.to_owned(), |part| format!("{}{text}{}", part.before, part.behind));
    let read = Program::decode(&whole(&vector.text));
    match (read, &vector.message, &vector.error) {
        (Ok(program), Some(message), None) => {
            let value = serde_json::to_value(&program)?;
            let found = part.map_or(Some(&value), |part| value.get(&part.list)?.get(0));
            ensure!(found == Some(message), "reads as {found:?}, not as {message}");
            match (program.to_text(&rules(&vector.options)), &vector.refused) {
                (Ok(written), None) => {
                    let expected = whole(vector.written.as_ref().unwrap_or(&vector.text));
                    ensure!(written == expected, "is written as {written:?}, not as {expected:?}");
                }
                (Err(error), Some(refused)) => {
                    ensure!(serde_json::to_value(error)? == *refused, "is refused: {error}, not {refused}");
                }
                (written, _) => bail!("written, it gives {written:?}"),
            }
        }
        (Err(error), None, Some(expected)) => {
            let before = part.map_or("", |part| &part.before);
            let mut found = error;
            found.line = found.line.saturating_sub(before.matches('\n').count());
            found.offset = found.offset.saturating_sub(before.len());
            ensure!(serde_json::to_value(found)? == *expected, "gives {error}, not {expected}");
        }
        (read, ..) => bail!("gives {read:?}"),
    }
    Ok(())
}

fn rules(options: &Options) -> Rules {
    let mut rules = Rules::default();
    rules.name_limit = options.name_limit.unwrap_or(rules.name_limit);
    if options.comment.as_deref() == Some("truncate") {
        rules.comment = CommentRule::Truncate;
    }
    rules
}
