//! The fields of a request.

use std::time::Duration;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// A command in the list that `help` prints.
#[derive(Debug)]
pub struct Command {
    /// The name of the command, the value of `do`.
    pub name: &'static str,
    /// The effect of the command, and its fields.
    pub about: &'static str,
    /// Requests that the device executes.
    pub examples: &'static [&'static str],
}

impl Command {
    /// Returns the command `get`, without fields.
    pub const fn get(about: &'static str) -> Self {
        Self { name: "get", about, examples: &[r#"{"do":"get"}"#] }
    }
}

/// A command and its fields.
#[derive(Debug)]
pub struct Args {
    /// The name of the command, the value of `do`.
    pub name: String,
    fields: Map<String, Value>,
}

impl Args {
    /// Parses the command of a request, and its `id`.
    ///
    /// # Errors
    /// The line is not an object with `do`.
    pub(super) fn parse(line: &[u8]) -> (Option<Value>, Result<Self, String>) {
        const HOW: &str = "give one object a line, such as {\"do\":\"help\"}";
        let mut fields: Map<String, Value> = match serde_json::from_slice(line) {
            Ok(fields) => fields,
            Err(error) => return (None, Err(format!("the line is not a JSON object ({error}); {HOW}"))),
        };
        let id = fields.shift_remove("id");
        match fields.shift_remove("do") {
            Some(Value::String(name)) => (id, Ok(Self { name, fields })),
            Some(_) => (id, Err(format!("`do` is not a text; {HOW}"))),
            None => (id, Err(format!("there is no `do`; {HOW}"))),
        }
    }

    /// Reads the fields of the command.
    ///
    /// # Errors
    /// A field is missing, unknown or has another type.
    pub fn read<T: DeserializeOwned>(self) -> Result<T, String> {
        serde_json::from_value(Value::Object(self.fields)).map_err(|error| error.to_string())
    }

    /// Checks that there are no fields.
    ///
    /// # Errors
    /// There is one; the error names it.
    pub fn none(self) -> Result<(), String> {
        match self.fields.keys().next() {
            Some(field) => Err(format!("unknown field `{field}`, the command has no fields")),
            None => Ok(()),
        }
    }
}

/// A time, in one of two units.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Time {
    ms: Option<f64>,
    seconds: Option<f64>,
}

impl Time {
    pub(super) const fn new(ms: Option<f64>, seconds: Option<f64>) -> Self {
        Self { ms, seconds }
    }

    /// Reads the time; `None` if neither field is given.
    pub(super) fn read(self) -> Result<Option<Duration>, String> {
        let seconds = match (self.ms, self.seconds) {
            (None, None) => return Ok(None),
            (Some(ms), None) => ms / 1000.0,
            (None, Some(seconds)) => seconds,
            (Some(_), Some(_)) => return Err("give `ms` or `seconds`, not both".into()),
        };
        if !(0.0..=3600.0).contains(&seconds) {
            return Err("a time is 0 to 3600 seconds".into());
        }
        Ok(Some(Duration::from_secs_f64(seconds)))
    }

    /// Reads the time, which must be given.
    pub(super) fn required(self) -> Result<Duration, String> {
        self.read()?.ok_or_else(|| "give the time, `ms` or `seconds`".into())
    }
}

/// Names in a sentence: `a, b or c`.
pub fn one_of(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [name] => (*name).into(),
        [names @ .., last] => format!("{} or {last}", names.join(", ")),
    }
}
