//! The settings of a link, a device or a client (`--set NAME=VALUE` and `--settings FILE`), and the fields of configurations as
//! `reference/` has them.

pub use robot_session::settings::*;

/// Returns the line of a TOML text that has a setting, otherwise the line of the table in which it would be.
pub fn line_of(text: &str, name: &str) -> Option<usize> {
    let document = toml::de::DeTable::parse(text).ok()?;
    let (mut table, mut at) = (document.get_ref(), None);
    let mut parts = name.split('.');
    while let Some(part) = parts.next() {
        let Some((key, mut value)) = table.iter().find(|(key, _)| key.get_ref() == part) else { break };
        at = Some(key.span().start);
        if let toml::de::DeValue::Array(array) = value.get_ref() {
            let Some(found) = parts.next().and_then(|place| array.get(place.parse::<usize>().ok()?)) else {
                break;
            };
            at = Some(found.span().start);
            value = found;
        }
        let toml::de::DeValue::Table(inner) = value.get_ref() else { break };
        table = inner;
    }
    Some(text.get(..at?)?.matches('\n').count() + 1)
}

/// Returns two lines for each setting: its name, values and default, and its purpose.
pub fn lines(settings: &[Setting]) -> String {
    let line = |setting: &Setting| {
        let (Setting { name, values, about, .. }, default) = (setting, setting.default_text());
        let equals = if default.is_empty() { "" } else { " = " };
        format!("  {name}{equals}{default}    ({values})\n        {about}\n")
    };
    settings.iter().map(line).collect()
}
