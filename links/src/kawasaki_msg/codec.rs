use anyhow::{Context, Result};
use kawasaki_msg::{Decoder, Dialect, Field, Message, PcConfig, Role, Takeover};
use serde::Deserialize;
use serde_json::{Map, Value};

#[cfg(feature = "arbitrary")]
use super::bytes::arbitrary_of;
use super::bytes::written;
use super::options::CodecSettings;
use super::plant::repeated_name;
use super::roles::Roles;
use crate::codec::{self, Codec, EncodeError, Kind, codec, message};
use crate::link::AcceptedMessage;
use crate::settings;

/// Creates the codec of either side: both send the same messages. The settings are those of [`CodecSettings`].
///
/// # Errors
/// If a setting is another.
pub(super) fn either(settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    let CodecSettings { plant, roles } = settings::read("kawasaki", CodecSettings::default(), settings)?;
    let (charset, dialect) =
        (plant.charset, plant.pc(PcConfig { takeover: Takeover::Never, ..PcConfig::tcp() })?.dialect);
    Ok(match roles {
        true => codec(Decoder::new(charset), Roles(dialect)),
        false => codec(Decoder::new(charset), Messages { dialect }),
    })
}

/// Accepts blanks around the length, and zeros before it; as roles, fields that the plant does not use.
pub(super) fn tolerates(it: &AcceptedMessage<'_>) -> bool {
    let plain = || {
        let data = it.bytes.iter().position(|byte| *byte == b'#')?;
        let (head, data) = it.bytes.split_at_checked(data)?;
        let length = head.iter().rposition(|byte| *byte == b'$')?;
        let digits = data.len().checked_sub("##>".len())?.to_string();
        Some([head.get(..=length)?, digits.as_bytes(), data].concat())
    };
    it.written.is_some_and(|written| {
        it.message.get("role").is_some() || plain().is_some_and(|plain| plain == written)
    })
}

struct Messages {
    dialect: Dialect,
}

/// A message object.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Object {
    name: String,
    #[serde(default)]
    header: Vec<String>,
    fields: Vec<String>,
}

impl codec::Messages for Messages {
    type Decoder = Decoder;

    fn show(&self, frame: Message<'_>, json: &mut Vec<u8>) -> Kind {
        message(&frame, json)
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>, EncodeError> {
        let object = Object::deserialize(&message).context("is not a kawasaki-msg message")?;
        let charset = self.dialect.charset();
        written(charset, &object.name, &object.header, &object.fields).map_err(EncodeError::refused)
    }

    fn names(&self, message: &Value) -> Vec<(String, &'static str)> {
        let entry = self.dialect.entries().iter().find(|entry| message["name"] == entry.name);
        let Some(entry) = entry else { return Vec::new() };
        let count = message["fields"].as_array().map_or(0, Vec::len);
        // A job's own fields are one of the table.
        let own = (count + 1).saturating_sub(entry.fields.len());
        let times = |field: &Field| if *field == Field::Work { own } else { 1 };
        let fields = entry.fields.iter().flat_map(|field| core::iter::repeat_n(field, times(field)));
        let named = |key: &'static str| {
            move |(at, field): (usize, &Field)| (format!("/{key}/{at}"), repeated_name(*field))
        };
        let header = entry.header.iter().enumerate().map(named("header"));
        header.chain(fields.enumerate().map(named("fields"))).collect()
    }

    fn is_filler(&self, message: &Value) -> bool {
        let mut fillers = self.dialect.entries().iter().filter(|entry| entry.role == Role::Filler);
        fillers.any(|entry| message["name"] == entry.name)
    }

    #[cfg(feature = "arbitrary")]
    fn arbitrary(&self, u: &mut arbitrary::Unstructured<'_>) -> arbitrary::Result<Value> {
        let wire = if u.arbitrary()? { Message::arbitrary(u)? } else { arbitrary_of(Dialect::DEFAULT, u)? };
        codec::object(
            &Message::decode(&wire, self.dialect.charset()).ok().flatten().map(|(message, _)| message),
        )
    }
}
