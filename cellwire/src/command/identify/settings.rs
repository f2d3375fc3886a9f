//! A finding as a file for `--settings`.

use core::fmt::Write as _;

use anyhow::Result;
use cellwire_identify::{DecidedBy, Finding, OpenSetting, OtherValue};
use serde_json::{Map, Value};

use super::input::Conversation;
use crate::command::settings::toml_value;
use cellwire_io::output::counted;

/// Returns the text of the file.
pub(super) fn toml(finding: &Finding) -> Result<String> {
    let mut text = format!("# {}: the options that explain a capture\n", finding.link.short);
    text.push_str(&options(finding, "#", &Map::new())?);
    for note in (finding.link.open.notes)(&finding.read) {
        writeln!(text, "# {note}")?;
    }
    for (name, value, why) in (finding.link.open.places)(&finding.read) {
        writeln!(text, "# {name}: {why}\n{name} = {value}")?;
    }
    Ok(text)
}

/// Returns the text of a draft with all other options of the link: a file that suffices. A ? marks each line to be checked.
pub(super) fn draft(finding: &Finding, conversation: &Conversation) -> Result<String> {
    let draft = cellwire_identify::draft(finding, &conversation.streams)?;
    let (head, words) = draft.split_once("\n\n").unwrap_or(("", &draft));
    let given: Map<String, Value> = toml::from_str(&draft)?;
    let options = options(finding, "# ?", &given)?;
    let blank = if options.is_empty() { "" } else { "\n" };
    Ok(format!("{head}\n\n{options}{blank}{words}"))
}

fn options(finding: &Finding, mark: &str, given: &Map<String, Value>) -> Result<String> {
    let mut text = String::new();
    for (name, value) in finding.settings.iter().filter(|(name, _)| !given.contains_key(*name)) {
        let inner = format!("{name}.");
        for option in finding.options.iter().filter(|it| it.name == *name || it.name.starts_with(&inner)) {
            let mark = if matches!(option.decided, DecidedBy::Not { .. }) { mark } else { "#" };
            remarks(&mut text, mark, option)?;
        }
        writeln!(text, "{name} = {}", toml_value(value).unwrap_or_default())?;
    }
    Ok(text)
}

/// Adds a comment on an option that the bytes do not decide.
pub(super) fn remarks(
    text: &mut String,
    mark: &str,
    OpenSetting { name, decided, .. }: &OpenSetting,
) -> Result<()> {
    match decided {
        DecidedBy::ByBytes => {}
        DecidedBy::ByValues => {
            writeln!(text, "{mark} {name}: other values give numbers or texts that make no sense")?
        }
        DecidedBy::Not { others, message } => {
            writeln!(
                text,
                "{mark} {name} is undecided: {}; {}",
                or(others),
                would_decide(others, message.as_deref())
            )?;
        }
    }
    Ok(())
}

/// Returns the other values, and the difference of each in explained bytes.
pub(super) fn or(others: &[OtherValue]) -> String {
    let mut groups: Vec<(String, Vec<String>)> = Vec::new();
    for OtherValue { value, fewer, inexact } in others {
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

/// Returns advice about the messages to capture.
pub(super) fn would_decide(others: &[OtherValue], message: Option<&str>) -> String {
    // The capture has such messages, and too few of them to decide.
    let is_seen = !others.is_empty() && others.iter().all(|other| other.fewer > 0);
    match message {
        Some(message) if is_seen => format!("one more of these would decide: {message}"),
        None if is_seen => "one more of these messages would decide".into(),
        Some(message) => format!("{message} would decide"),
        None => "beside the other options it makes no difference".into(),
    }
}

/// Returns a value in the form in which it is written after `--set NAME=`.
pub(super) fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_that_the_capture_has_is_wanted_once_more() {
        let other = |fewer| [OtherValue { value: "ascii".into(), fewer, inexact: 0 }];
        let letter = Some("a name with a letter beyond ASCII");
        assert_eq!(would_decide(&other(0), letter), "a name with a letter beyond ASCII would decide");
        assert_eq!(
            would_decide(&other(20), letter),
            "one more of these would decide: a name with a letter beyond ASCII"
        );
    }
}
