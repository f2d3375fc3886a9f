//! The agreement of both ends of a plant, as settings: the table of messages (in a file the tables `[messages.ROLE]`), the fields
//! of a job (in a file the tables `[[job]]`), and the way in which packets are carried and acknowledged.

use std::collections::{BTreeMap, btree_map};
use std::sync::{Mutex, PoisonError};

use anyhow::Result;
use kawasaki_msg::{
    Acks, Bounds, Charset, ConfigError, Dialect, Entry, Field, LargePc, Limits, PcConfig, RobotConfig, Role,
};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::layout::{AnyWork, Layout};
use crate::json;
use crate::settings::{Configure, FieldVisitor, RefusedSetting};

/// The agreement of both ends of a plant.
#[derive(Debug, Clone)]
pub struct Plant {
    /// The character set of names and fields.
    pub charset: Charset,
    /// Whether packets are datagrams.
    pub udp: bool,
    /// The limits of a packet in bytes.
    pub limits: Limits,
    /// The highest job number, 2 to 9999.
    pub max_number: u16,
    /// The way in which executed jobs are acknowledged.
    pub acks: Acks,
    /// The coordinates of the drawing's lines, if jobs are lines.
    pub bounds: Bounds,
    /// The fields of a job; without them it is a line of a drawing.
    pub(super) job: Option<Vec<Value>>,
    /// The messages, by the names of their roles.
    messages: BTreeMap<String, Message>,
}

/// One message of the table.
#[derive(Debug, Clone)]
struct Message {
    default: Entry,
    sent: bool,
    name: String,
    header: Vec<FieldSetting>,
    fields: Vec<FieldSetting>,
}

/// A message as a configuration of the reference has it.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct GivenMessage {
    name: String,
    #[serde(default)]
    header: Vec<FieldSetting>,
    fields: Vec<FieldSetting>,
}

impl Default for Plant {
    fn default() -> Self {
        let settings = |fields: &[Field]| fields.iter().map(FieldSetting::from).collect();
        let messages = Dialect::DEFAULT.entries().iter().map(|entry| {
            let (header, fields) = (settings(entry.header), settings(entry.fields));
            let message = Message { default: *entry, sent: true, name: entry.name.into(), header, fields };
            (role_name(entry.role), message)
        });
        let RobotConfig { limits, max_number, acks, .. } = RobotConfig::tcp();
        let (charset, bounds) = (Charset::Ascii, Bounds::WIDEST);
        Self {
            charset,
            udp: false,
            limits,
            max_number,
            acks,
            bounds,
            job: None,
            messages: messages.collect(),
        }
    }
}

impl Configure for Plant {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { charset, udp, limits, max_number, acks, bounds, job, messages } = self;
        let choices = [("ascii", Charset::Ascii), ("latin1", Charset::Latin1)];
        fields.choice("charset", &choices, "the characters of names and fields", charset);
        let about = "use UDP, where packets can be lost, repeated and late; the source uses TCP";
        fields.flag("udp", about, udp);
        if *udp {
            *limits = Limits::UDP;
        }
        fields.group("limits", |fields| limits.configure(fields));
        let about = "the highest job number; above the jobs of the robot's queue";
        fields.whole("max_number", 2..=Dialect::MAX_NUMBER, "", about, max_number);
        acks.configure(fields);
        const SHAPE: &str =
            "tables [[job]]: name; kind: whole, decimal with places, or text; range or length; default";
        let about = "a job's own fields in order; by default a line of a drawing";
        let line = Layout::default().given();
        let mut given = job.take().unwrap_or_else(|| line.clone());
        fields.parsed("job", SHAPE, about, &mut given);
        *job = (given != line).then_some(given);
        fields.group("bounds", |fields| bounds.configure(fields));
        fields.group("messages", |fields| {
            for (role, message) in messages {
                fields.group(role, |fields| message.configure(fields));
            }
        });
    }
}

impl Configure for Message {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        const FIELDS: &str =
            "a list of order, number, work, queued, executed, ended, phase, unused, or =TEXT";
        let Self { default: _, sent, name, header, fields: own } = self;
        fields.flag("sent", "false if the plant has no such message", sent);
        let mut called = Some(core::mem::take(name));
        fields.text("name", "a name", "the message is invalid", "the name of the message", &mut called);
        *name = called.unwrap_or_default();
        fields.parsed("header", FIELDS, "the fields between name and length", header);
        let about = "its fields in order; work: all of a job's own fields, =TEXT: a constant text";
        fields.parsed("fields", FIELDS, about, own);
    }
}

impl Plant {
    /// Returns the table of messages. The table is made once, and stays in memory as long as the tool runs.
    ///
    /// # Errors
    /// If the table contradicts itself, or lacks a message that every session needs.
    pub fn dialect(&self) -> Result<Dialect> {
        static MADE: Mutex<BTreeMap<String, Dialect>> = Mutex::new(BTreeMap::new());
        let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
        let dialect = match made.entry(format!("{:?}", self.messages)) {
            btree_map::Entry::Occupied(made) => *made.get(),
            btree_map::Entry::Vacant(place) => {
                let entries = self.messages.values().filter(|message| message.sent).map(Message::entry);
                *place.insert(Dialect::new(entries.collect::<Vec<_>>().leak()).map_err(refused)?)
            }
        };
        Ok(dialect.with_charset(self.charset))
    }

    /// Replaces messages by role, as in a configuration of the reference: `null` if the plant lacks a message.
    ///
    /// # Errors
    /// If there is no such role, or if an object is not a message.
    pub(super) fn replace(&mut self, messages: Map<String, Value>) -> Result<()> {
        for (role, given) in messages {
            let known = self.messages.get(&role).map(|message| message.default);
            let default = match (known, role.strip_prefix("command_")) {
                (Some(default), _) => default,
                (None, Some(id)) => {
                    let role = Role::Command(id.parse()?);
                    Entry { role, name: "", header: &[], fields: &[] }
                }
                (None, None) => anyhow::bail!("no message has the role {role}"),
            };
            let (sent, GivenMessage { name, header, fields }) = match given {
                Value::Null => (false, GivenMessage::default()),
                given => (true, GivenMessage::deserialize(&given)?),
            };
            self.messages.insert(role, Message { default, sent, name, header, fields });
        }
        Ok(())
    }

    /// Returns the layout of a job.
    ///
    /// # Errors
    /// If a field contradicts itself or another one.
    pub fn layout(&self) -> Result<Layout> {
        match &self.job {
            None => Ok(Layout::line(self.bounds)),
            Some(given) => Ok(Layout::read(given, self.charset)?),
        }
    }

    /// Checks that both ends can work in this plant; a PC with the [`Takeover`](kawasaki_msg::Takeover) that the plant's
    /// messages allow.
    ///
    /// # Errors
    /// If the plant contradicts itself, or lacks a message or a field that no end can do without.
    pub fn check(&self) -> Result<()> {
        let takeover = kawasaki_msg::Takeover::Never;
        self.pc(PcConfig { takeover, ..PcConfig::tcp() }).map(drop)
    }

    /// Returns a PC's configuration in this plant.
    ///
    /// # Errors
    /// If it cannot work.
    pub fn pc(&self, config: PcConfig) -> Result<PcConfig> {
        let config = PcConfig {
            dialect: self.dialect()?,
            limits: self.limits,
            datagrams: self.udp,
            max_number: self.max_number,
            cumulative_acks: self.acks != Acks::Individual,
            ..config
        };
        LargePc::<&[AnyWork]>::with_ranges(config, self.layout()?).map_err(refused)?;
        Ok(config)
    }

    /// Returns a robot's configuration in this plant.
    ///
    /// # Errors
    /// If it cannot work.
    pub fn robot(&self, config: RobotConfig) -> Result<RobotConfig> {
        // A PC rejects a plant's contradictions as well, except for messages that only a PC needs.
        let takeover = kawasaki_msg::Takeover::Never;
        let PcConfig { dialect, limits, datagrams, max_number, .. } =
            self.pc(PcConfig { takeover, ..PcConfig::tcp() })?;
        Ok(RobotConfig { dialect, limits, datagrams, max_number, acks: self.acks, ..config })
    }
}

/// Returns the refusal of the setting that an error is about.
fn refused(error: ConfigError) -> RefusedSetting {
    let name = match error {
        ConfigError::MaxNumber { .. } => "max_number".into(),
        ConfigError::Limits { .. } => "limits".into(),
        ConfigError::EmptyRange { .. } | ConfigError::JobTooLong { .. } => "job".into(),
        error => role(&error).map_or("messages".into(), |role| format!("messages.{}", role_name(role))),
    };
    let advice = match error {
        ConfigError::Lacks { role: Role::OrderInterrupt } => {
            "; with takeover=end or never it does not".into()
        }
        ConfigError::Lacks { role: Role::JobAck } => "; with acks=1 it does not".into(),
        ConfigError::Role { .. } => format!("; set {name}.name"),
        ConfigError::Name { .. } => format!("; set {name}.name to a name that no other message has"),
        ConfigError::MissingField { field, .. } => {
            let field = field_name(field).unwrap_or_default();
            format!("; write {field} in {name}.fields or {name}.header, at its place in the message")
        }
        ConfigError::Fields { role } => {
            let default = Dialect::DEFAULT.entry(role).map_or(&[][..], |entry| entry.fields);
            let known: Vec<&str> = default.iter().filter_map(|field| field_name(*field)).collect();
            let known = known.iter().map(|name| format!("{name} once, ")).collect::<String>();
            format!("; {name}.header and {name}.fields may have {known}unused, and =TEXT for a constant")
        }
        _ => String::new(),
    };
    RefusedSetting { text: format!("{name}: {error}{advice}"), name }
}

impl Message {
    fn entry(&self) -> Entry {
        let fields = |settings: &[FieldSetting]| -> &'static [Field] {
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

const NAMES: [(&str, Field); 9] = [
    ("order", Field::Order),
    ("ended", Field::Ended),
    ("phase", Field::Phase),
    ("number", Field::Number),
    ("queued", Field::Queued),
    ("executed", Field::Executed),
    ("value", Field::Value),
    ("work", Field::Work),
    ("unused", Field::Unused),
];

impl FieldSetting {
    fn field(&self) -> Field {
        match self.0.strip_prefix('=') {
            Some(text) => Field::Constant(String::leak(text.into())),
            None => NAMES.iter().find(|(name, _)| *name == self.0).map_or(Field::Unused, |(_, field)| *field),
        }
    }
}

impl From<&Field> for FieldSetting {
    fn from(field: &Field) -> Self {
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
        if is_known { Ok(Self(text)) } else { Err(format!("`{text}` is not a field")) }
    }
}

impl From<FieldSetting> for String {
    fn from(FieldSetting(text): FieldSetting) -> Self {
        text
    }
}

/// Returns the role of the message that an error is about.
fn role(error: &ConfigError) -> Option<Role> {
    match *error {
        ConfigError::Role { role }
        | ConfigError::MissingField { role, .. }
        | ConfigError::Fields { role }
        | ConfigError::TooManyFields { role, .. }
        | ConfigError::Constant { role, .. }
        | ConfigError::Lacks { role }
        | ConfigError::LateMessages { role }
        | ConfigError::Name { role } => Some(role),
        _ => None,
    }
}

/// Returns the name of a field in settings and in JSON; `None` for a constant.
pub(super) fn field_name(field: Field) -> Option<&'static str> {
    NAMES.iter().find(|(_, known)| *known == field).map(|(name, _)| *name)
}

/// Returns the name of a role in settings and in JSON.
pub(super) fn role_name(role: Role) -> String {
    match role {
        Role::Command(id) => format!("command_{id}"),
        role => json::value(role).as_str().unwrap_or_default().into(),
    }
}

/// Returns the name that a field has in common with those that repeat its value.
pub(super) fn repeated_name(field: Field) -> &'static str {
    match field {
        Field::Order | Field::Ended => "order",
        Field::Number | Field::Queued | Field::Executed => "number",
        field => field_name(field).unwrap_or("constant"),
    }
}
