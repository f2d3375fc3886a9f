//! What can be set of a link, a device or a client: `--set NAME=VALUE` and `--settings FILE`.
//!
//! A configuration visits its settings in [`Configure::configure`], each with its name, values, unit and a line of help. That one
//! table reads the values that were given, refuses the others, and is what `--help` prints: the defaults are those of the
//! configuration itself.

mod kinds;
mod line;
#[cfg(test)]
mod tests;

use std::borrow::Cow;

use anyhow::{Result, bail};
use serde_json::{Map, Value};

pub use kinds::{ANY_TIME, BAUD_RATES, SOME_TIME, json};
pub use line::line_of;

/// A configuration whose settings have names.
pub trait Configure {
    /// Visits every setting, each by one call of the table.
    fn configure(&mut self, table: &mut Table<'_>);
}

/// Settings with nothing to set.
impl Configure for () {
    fn configure(&mut self, _: &mut Table<'_>) {}
}

/// A setting as `--help` shows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Setting {
    /// Its name; in a TOML file what is before a dot is a table.
    pub name: String,
    /// Which values it takes, with their unit.
    pub values: String,
    /// Its value where none is given, as it is written; nothing where `values` says what happens instead.
    pub default: String,
    /// What it is for.
    pub about: &'static str,
}

/// A setting that is refused, and why.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{text}")]
pub struct Refused {
    /// Its name.
    pub name: String,
    /// What is wrong, and what to give.
    pub text: String,
}

/// The settings of a configuration, while they are visited.
#[derive(Debug)]
pub struct Table<'a> {
    prefix: String,
    visited: Vec<Setting>,
    given: Option<&'a Map<String, Value>>,
    refused: Option<Refused>,
}

/// A configuration with the values that were given. `what` is what it configures.
///
/// # Errors
/// When a name is no setting of it, or a value is none of the setting's.
pub fn read<C: Configure>(what: &str, mut config: C, given: &Map<String, Value>) -> Result<C> {
    let mut table = Table { prefix: String::new(), visited: Vec::new(), given: Some(given), refused: None };
    config.configure(&mut table);
    let names: Vec<&str> = table.visited.iter().map(|setting| setting.name.as_str()).collect();
    if let Some(unknown) = unknown(given, "", &names) {
        match names.is_empty() {
            true => bail!("{what} has no setting `{unknown}`: it has no settings"),
            false => bail!("{what} has no setting `{unknown}`: it has {}", names.join(", ")),
        }
    }
    match table.refused {
        None => Ok(config),
        Some(error) => bail!(error),
    }
}

/// The settings of a configuration, with its values as their defaults.
pub fn list(mut config: impl Configure) -> Vec<Setting> {
    let mut table = Table { prefix: String::new(), visited: Vec::new(), given: None, refused: None };
    config.configure(&mut table);
    table.visited
}

/// Puts a value at its name, in a table where the name has dots.
///
/// # Errors
/// When what is before a dot has a value that is no table.
pub fn insert(settings: &mut Map<String, Value>, name: &str, value: Value) -> Result<()> {
    let Some((table, rest)) = name.split_once('.') else {
        return match (settings.get_mut(name), value) {
            (Some(Value::Object(before)), Value::Object(after)) => merge(before, after),
            (_, value) => {
                settings.insert(name.into(), value);
                Ok(())
            }
        };
    };
    match settings.entry(table).or_insert_with(|| Map::new().into()) {
        Value::Object(inner) => insert(inner, rest, value),
        other => bail!("{name}: `{table}` is {other}, which has no settings in it"),
    }
}

/// The parser of `--set`: a value that is valid JSON is read as JSON, any other as text.
///
/// # Errors
/// When there is no `=`, or no name before it.
pub fn parse(text: &str) -> Result<(String, Value), String> {
    let (name, value) = text.split_once('=').ok_or("give NAME=VALUE")?;
    if name.split('.').any(str::is_empty) {
        return Err("give NAME=VALUE, such as baud=19200".into());
    }
    let value = serde_json::from_str(value).unwrap_or_else(|_| Value::String(value.into()));
    Ok((name.into(), value))
}

impl Table<'_> {
    /// Visits settings whose names begin with `name` and a dot.
    pub fn group(&mut self, name: &str, configure: impl FnOnce(&mut Self)) {
        let outer = self.prefix.len();
        self.prefix.push_str(name);
        self.prefix.push('.');
        configure(self);
        self.prefix.truncate(outer);
    }

    /// Visits a setting: `set` gets the value if one is given, and says what is wrong with it.
    fn visit(
        &mut self,
        name: &str,
        about: &'static str,
        values: String,
        default: String,
        set: impl FnOnce(&Value) -> Result<(), Cow<'static, str>>,
    ) {
        let name = format!("{}{name}", self.prefix);
        if let Some(value) = self.given.and_then(|given| find(given, &name))
            && let Err(why) = set(value)
        {
            let text = format!("{name}={}: {why}, give {values}", plain(value));
            self.refused.get_or_insert_with(|| Refused { name: name.clone(), text });
        }
        self.visited.push(Setting { name, values, default, about });
    }
}

/// The value of a name, in tables where it has dots.
fn find<'a>(given: &'a Map<String, Value>, name: &str) -> Option<&'a Value> {
    match name.split_once('.') {
        None => given.get(name),
        Some((table, rest)) => find(given.get(table)?.as_object()?, rest),
    }
}

/// The first name that is none of `names`, nor in the table of one.
fn unknown(given: &Map<String, Value>, prefix: &str, names: &[&str]) -> Option<String> {
    given.iter().find_map(|(key, value)| {
        let name = format!("{prefix}{key}");
        if names.contains(&name.as_str()) {
            return None;
        }
        let inner = format!("{name}.");
        match value {
            Value::Object(table) if names.iter().any(|known| known.starts_with(&inner)) => {
                unknown(table, &inner, names)
            }
            _ => Some(name),
        }
    })
}

fn merge(before: &mut Map<String, Value>, after: Map<String, Value>) -> Result<()> {
    after.into_iter().try_for_each(|(name, value)| insert(before, &name, value))
}

/// A value as it is written after `--set NAME=`.
fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}
