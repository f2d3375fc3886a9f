//! What was found, as a file for `--settings`.

use core::fmt::Write as _;

use crate::command::settings::toml_value;
use anyhow::Result;
use cellwire_identify::{Decided, Finding, Open};
use serde_json::Value;

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

/// The other values that explain the same.
pub(super) fn or(others: &[Value]) -> String {
    match others {
        [] => "any other value explains the same".into(),
        _ => {
            let others: Vec<String> = others.iter().map(plain).collect();
            format!("{} explains the same", others.join(" or "))
        }
    }
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
