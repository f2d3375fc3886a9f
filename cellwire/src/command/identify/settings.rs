//! What was found, as a file for `--settings`.

use core::fmt::Write as _;

use anyhow::Result;
use cellwire_identify::{Decided, Finding, Open, Other};
use serde_json::Value;

use crate::command::settings::toml_value;
use cellwire_io::output::counted;

/// The text of the file.
pub(super) fn toml(finding: &Finding) -> Result<String> {
    let mut text = format!("# {}: the options that explain a capture\n", finding.link.short);
    for (name, value) in &finding.settings {
        let inner = format!("{name}.");
        for option in finding.options.iter().filter(|it| it.name == *name || it.name.starts_with(&inner)) {
            remarks(&mut text, "#", option)?;
        }
        writeln!(text, "{name} = {}", toml_value(value).unwrap_or_default())?;
    }
    for note in (finding.link.open.notes)(&finding.read) {
        writeln!(text, "# {note}")?;
    }
    for (name, value, why) in (finding.link.open.places)(&finding.read) {
        writeln!(text, "# {name}: {why}\n{name} = {value}")?;
    }
    Ok(text)
}

/// A comment on an option that the bytes do not decide.
pub(super) fn remarks(text: &mut String, mark: &str, Open { name, decided, .. }: &Open) -> Result<()> {
    match decided {
        Decided::ByBytes => {}
        Decided::ByValues => {
            writeln!(text, "{mark} {name}: other values give numbers or texts that make no sense")?
        }
        Decided::Not { others, message } => {
            writeln!(
                text,
                "{mark} {name} is undecided: {}; {}",
                or(others),
                would_decide(message.as_deref())
            )?;
        }
    }
    Ok(())
}

/// The other values, and how much less each explains.
pub(super) fn or(others: &[Other]) -> String {
    let mut groups: Vec<(String, Vec<String>)> = Vec::new();
    for Other { value, fewer, inexact } in others {
        let explains = match (fewer, inexact) {
            (0, 0) => "explains the same".to_owned(),
            (0, _) => format!("explains the same, {} less exactly", counted(*inexact, "byte")),
            _ => format!("explains {} less", counted(*fewer, "byte")),
        };
        match groups.iter_mut().find(|(known, _)| *known == explains) {
            Some((_, values)) => values.push(plain(value)),
            None => groups.push((explains, vec![plain(value)])),
        }
    }
    if groups.is_empty() {
        return "any other value explains the same".into();
    }
    let groups = groups.iter().map(|(explains, values)| format!("{} {explains}", values.join(" or ")));
    groups.collect::<Vec<_>>().join(", ")
}

/// What to capture.
pub(super) fn would_decide(message: Option<&str>) -> String {
    match message {
        Some(message) => format!("{message} would decide"),
        None => "beside the other options it makes no difference".into(),
    }
}

/// A value as it is written after `--set NAME=`.
pub(super) fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}
