//! Messages by their roles in the plant's table, regardless of their names there.

use anyhow::{Context, anyhow};
use kawasaki_msg::{Decoder, Dialect, Field, Message, Params, Role};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::bytes::written;
use super::plant::{field_name, repeated_name, role_name};
use crate::codec::{self, EncodeError, Kind, error, message};

/// Reads and writes `{"role": …, "values": {…}, "work": […]}`.
pub(super) struct Roles(pub(super) Dialect);

/// A message object.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Object {
    role: String,
    #[serde(default)]
    values: Map<String, Value>,
    /// A job's own fields.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    work: Vec<String>,
}

impl codec::Messages for Roles {
    type Decoder = Decoder;

    fn show(&self, frame: Message<'_>, json: &mut Vec<u8>) -> Kind {
        let (role, params) = match self.0.read(&frame) {
            Ok(read) => read,
            Err(wrong) => return error(&wrong, json),
        };
        let entry = self.0.entry(role);
        let fields = entry.into_iter().flat_map(|entry| entry.header.iter().chain(entry.fields));
        let values =
            fields.filter_map(|field| Some((field_name(*field)?.into(), params.get(*field)?.into())));
        let work = self.0.work_values(&frame).map(|value| value.to_string()).collect();
        message(&Object { role: role_name(role), values: values.collect(), work }, json)
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>, EncodeError> {
        let Object { role, values, work } =
            Object::deserialize(&message).context("is not a message of a role")?;
        let entry = self.0.entries().iter().find(|entry| role_name(entry.role) == role);
        let entry = entry.with_context(|| format!("the plant has no message of the role `{role}`"))?;
        let (mut params, mut used) = (Params::default(), 0);
        for field in entry.header.iter().chain(entry.fields) {
            if let Some(value) = field_name(*field).and_then(|name| values.get(name)) {
                let number = value.as_i64().and_then(|number| i32::try_from(number).ok());
                params.set(*field, number.with_context(|| format!("{value} is not a 32-bit integer"))?);
                used += 1;
            }
        }
        if used < values.len() {
            let values = Value::Object(values);
            Err(anyhow!("a value is not a field of the message `{}`: {values}", entry.name))?;
        }
        let text = |field: &Field| match field {
            Field::Constant(text) => (*text).into(),
            field => params.get(*field).map_or_else(String::new, |number| number.to_string()),
        };
        let header: Vec<String> = entry.header.iter().map(text).collect();
        let fields = entry.fields.iter().flat_map(|field| match field {
            Field::Work => work.clone(),
            field => vec![text(field)],
        });
        let fields: Vec<String> = fields.collect();
        let wire = written(self.0.charset(), entry.name, &header, &fields).map_err(EncodeError::refused)?;
        // Reject a message that the plant could not read.
        let read = Message::decode(&wire, self.0.charset()).map_err(EncodeError::refused)?;
        self.0.read(&read.context("it is not whole")?.0).map_err(EncodeError::refused)?;
        Ok(wire)
    }

    fn names(&self, message: &Value) -> Vec<(String, &'static str)> {
        let entry = self.0.entries().iter().find(|entry| message["role"] == role_name(entry.role));
        let fields = entry.into_iter().flat_map(|entry| entry.header.iter().chain(entry.fields));
        let named = |field: &Field| Some((format!("/values/{}", field_name(*field)?), repeated_name(*field)));
        fields.filter_map(named).collect()
    }

    fn is_filler(&self, message: &Value) -> bool {
        message["role"] == role_name(Role::Filler)
    }

    #[cfg(feature = "arbitrary")]
    fn arbitrary(&self, u: &mut arbitrary::Unstructured<'_>) -> arbitrary::Result<Value> {
        let wire = super::bytes::arbitrary_of(self.0, u)?;
        let mut json = Vec::new();
        if let Ok(Some((message, _))) = Message::decode(&wire, self.0.charset()) {
            self.show(message, &mut json);
        }
        serde_json::from_slice(&json).map_err(|_| arbitrary::Error::IncorrectFormat)
    }
}
