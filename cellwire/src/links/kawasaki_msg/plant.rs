//! The plant's table of messages as settings: in a file they are the tables `[messages.ROLE]`.

use std::collections::BTreeMap;

use anyhow::Result;
use kawasaki_msg::{Charset, ConfigError, Dialect, Entry, Field, Role};
use serde::{Deserialize, Serialize};

use crate::links::settings::{Configure, Refused, Table, json};

/// The plant's messages.
#[derive(Debug, Clone)]
pub struct Plant {
    /// The character set of names and fields.
    pub charset: Charset,
    /// The messages, by the names of their roles.
    messages: BTreeMap<String, Message>,
}

/// One message of the table.
#[derive(Debug, Clone)]
struct Message {
    default: Entry<'static>,
    sent: bool,
    name: String,
    header: Vec<FieldSetting>,
    fields: Vec<FieldSetting>,
}

impl Default for Plant {
    fn default() -> Self {
        let settings = |fields: &[Field<'_>]| fields.iter().map(FieldSetting::from).collect();
        let messages = Dialect::DEFAULT.entries().iter().map(|entry| {
            let (header, fields) = (settings(entry.header), settings(entry.fields));
            let message = Message { default: *entry, sent: true, name: entry.name.into(), header, fields };
            (role_name(entry.role), message)
        });
        Self { charset: Charset::Ascii, messages: messages.collect() }
    }
}

impl Configure for Plant {
    fn configure(&mut self, table: &mut Table<'_>) {
        let choices = [("ascii", Charset::Ascii), ("latin1", Charset::Latin1)];
        table.choice("charset", &choices, "the characters of names and fields", &mut self.charset);
        table.group("messages", |table| {
            for (role, message) in &mut self.messages {
                table.group(role, |table| message.configure(table));
            }
        });
    }
}

impl Configure for Message {
    fn configure(&mut self, table: &mut Table<'_>) {
        const FIELDS: &str =
            "a list of order, number, work, queued, executed, ended, phase, unused, or =TEXT";
        table.flag("sent", "false where the plant has no such message", &mut self.sent);
        let mut name = Some(core::mem::take(&mut self.name));
        table.text("name", "a name", "the message cannot be", "what the message is called", &mut name);
        self.name = name.unwrap_or_default();
        let default = json(&self.header);
        table.parsed("header", FIELDS, default, "what is between name and length", &mut self.header);
        let about = "its fields in order; work: all of a job's own, =TEXT: always this text";
        let default = json(&self.fields);
        table.parsed("fields", FIELDS, default, about, &mut self.fields);
    }
}

impl Plant {
    /// The table of messages. It is made once, and kept as long as the tool runs.
    ///
    /// # Errors
    /// When the table contradicts itself, or lacks what no session can do without.
    pub fn dialect(&self) -> Result<Dialect<'static>> {
        let entries = Dialect::DEFAULT.entries().iter().filter_map(|default| {
            let message = self.messages.get(&role_name(default.role))?;
            message.sent.then(|| message.entry())
        });
        let dialect = Dialect::new(entries.collect::<Vec<_>>().leak()).map_err(|error| {
            let name = role(&error).map_or("messages".into(), |role| format!("messages.{}", role_name(role)));
            Refused { text: format!("{name}: {error}"), name }
        })?;
        Ok(dialect.with_charset(self.charset))
    }
}

impl Message {
    fn entry(&self) -> Entry<'static> {
        let fields = |settings: &[FieldSetting]| -> &'static [Field<'static>] {
            settings.iter().map(FieldSetting::field).collect::<Vec<_>>().leak()
        };
        let (header, fields) = (fields(&self.header), fields(&self.fields));
        Entry { name: String::leak(self.name.clone()), header, fields, ..self.default }
    }
}

/// A field by its name, or `=` and a constant.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
struct FieldSetting(String);

const NAMES: [(&str, Field<'static>); 8] = [
    ("order", Field::Order),
    ("ended", Field::Ended),
    ("phase", Field::Phase),
    ("number", Field::Number),
    ("queued", Field::Queued),
    ("executed", Field::Executed),
    ("work", Field::Work),
    ("unused", Field::Unused),
];

impl FieldSetting {
    fn field(&self) -> Field<'static> {
        match self.0.strip_prefix('=') {
            Some(text) => Field::Constant(String::leak(text.into())),
            None => NAMES.iter().find(|(name, _)| *name == self.0).map_or(Field::Unused, |(_, field)| *field),
        }
    }
}

impl From<&Field<'_>> for FieldSetting {
    fn from(field: &Field<'_>) -> Self {
        match field {
            Field::Constant(text) => Self(format!("={text}")),
            field => Self(field_name(*field).unwrap_or("unused").into()),
        }
    }
}

impl TryFrom<String> for FieldSetting {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let is_known = text.starts_with('=') || NAMES.iter().any(|(name, _)| *name == text);
        if is_known { Ok(Self(text)) } else { Err(format!("`{text}` is no field")) }
    }
}

impl From<FieldSetting> for String {
    fn from(FieldSetting(text): FieldSetting) -> Self {
        text
    }
}

/// The message that cannot be.
fn role(error: &ConfigError) -> Option<Role> {
    match *error {
        ConfigError::Role { role }
        | ConfigError::MissingField { role, .. }
        | ConfigError::Fields { role }
        | ConfigError::TooManyFields { role, .. }
        | ConfigError::Name { role } => Some(role),
        _ => None,
    }
}

/// What a field is called in settings and in JSON; nothing where it is a constant.
pub(super) fn field_name(field: Field<'_>) -> Option<&'static str> {
    NAMES.iter().find(|(_, known)| *known == field).map(|(name, _)| *name)
}

/// What a role is called in settings and in JSON.
pub(super) fn role_name(role: Role) -> String {
    match role {
        Role::Command(id) => format!("command_{id}"),
        role => json(&role).trim_matches('"').into(),
    }
}
