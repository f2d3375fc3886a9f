//! What the source leaves open of the characters. The names of a plant's messages are its table, no setting of the bytes.

use super::options::CodecSettings;
use anyhow::Result;
use kawasaki_msg::{Dialect, Entry};
use serde_json::{Map, Value};

use crate::link::{Deciding, Open};
use crate::settings;

pub(super) const OPEN: Open = Open {
    settings: &["charset"],
    beside: &[],
    guess: None,
    deciding: &[Deciding {
        side: "pc",
        about: "a name or field with a letter beyond ASCII",
        message: r#"{"name":"Määrä","fields":["1"]}"#,
    }],
    reads_more: &[],
    rust: |given, _| rust(given),
    notes,
    ..Open::NOTHING
};

/// The table of messages, where it is not the default one, and the character set.
fn rust(given: &Map<String, Value>) -> Result<String> {
    let plant = settings::read("kawasaki", CodecSettings::default(), given)?.plant;
    let (dialect, charset) = (plant.dialect()?, plant.charset);
    let default = Dialect::DEFAULT.entries();
    if dialect.entries().len() == default.len()
        && dialect.entries().iter().all(|entry| default.contains(entry))
    {
        return Ok(format!(
            "use kawasaki_msg::Charset;\n\npub fn charset() -> Charset {{\n    Charset::{charset:?}\n}}"
        ));
    }
    let mut text = String::from("use kawasaki_msg::{Charset, ConfigError, Dialect, Entry, Field, Role};\n\n");
    text.push_str(&format!("static MESSAGES: [Entry; {}] = [\n", dialect.entries().len()));
    for Entry { role, name, header, fields } in dialect.entries() {
        let [header, fields] = [header, fields].map(|fields| {
            fields.iter().map(|field| format!("Field::{field:?}")).collect::<Vec<_>>().join(", ")
        });
        text.push_str(&format!(
            "    Entry {{\n        role: Role::{role:?},\n        name: {name:?},\n        header: &[{header}],\n        fields: &[{fields}],\n    }},\n"
        ));
    }
    text.push_str(&format!(
        "];\n\npub fn dialect() -> Result<Dialect, ConfigError> {{\n    Ok(Dialect::new(&MESSAGES)?.with_charset(Charset::{charset:?}))\n}}"
    ));
    Ok(text)
}

/// The names that the default table of messages does not have.
fn notes(messages: &[(&'static str, Value)]) -> Vec<String> {
    let is_own = |name: &&str| Dialect::DEFAULT.entries().iter().all(|entry| entry.name != *name);
    let names = messages.iter().filter_map(|(_, message)| message["name"].as_str());
    let mut own: Vec<&str> = names.filter(is_own).collect();
    own.sort_unstable();
    own.dedup();
    let Some(first) = own.first() else { return Vec::new() };
    vec![format!(
        "{} names of messages are the plant's own, such as {first}: its ends need its table (--draft FILE)",
        own.len()
    )]
}
