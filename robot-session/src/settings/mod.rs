//! Configurations as files have them: times with a unit, such as `250ms` or `never`, and everything by the name of its field.
//!
//! A configuration visits its fields in [`Configure::configure`], each with its name, values, unit and a line of help. That
//! one table reads the given values, refuses the others, and provides a program's `--help`: the defaults are those of the
//! configuration itself. [`deserialize!`](crate::deserialize) makes a configuration a part of a program's own:
//!
//! ```
//! # use core::time::Duration;
//! # use robot_session::spec::{Configure, FieldVisitor, SOME_TIME};
//! # #[derive(Debug)]
//! # struct HostConfig { resends: u8, timeout: Duration }
//! # impl HostConfig { const DEFAULT: Self = Self { resends: 3, timeout: Duration::from_secs(1) }; }
//! # impl Configure for HostConfig {
//! #     fn configure(&mut self, fields: &mut impl FieldVisitor) {
//! #         fields.whole("resends", 0..=u8::MAX, "times", "how often a frame is sent again", &mut self.resends);
//! #         fields.time("timeout", SOME_TIME, "the reply timeout", &mut self.timeout);
//! #     }
//! # }
//! robot_session::deserialize!(HostConfig, HostConfig::DEFAULT);
//!
//! #[derive(serde::Deserialize)]
//! struct Cell {
//!     address: String,
//!     host: HostConfig,
//! }
//!
//! let cell: Cell = serde_json::from_str(r#"{"address": "10.0.0.7:502", "host": {"timeout": "250ms"}}"#)?;
//! assert_eq!((cell.host.timeout, cell.host.resends), (Duration::from_millis(250), 3));
//! let refused = serde_json::from_str::<Cell>(r#"{"address": "", "host": {"timeout": 250}}"#).err().unwrap();
//! assert!(refused.to_string().contains("not a time with its unit"));
//! # Ok::<(), serde_json::Error>(())
//! ```

mod kinds;
#[cfg(test)]
mod tests;
mod times;

use std::borrow::{Cow, ToOwned as _};
use std::format;
use std::string::{String, ToString as _};
use std::vec::Vec;

use serde::de::Error as _;
#[doc(hidden)]
pub use serde::de::{Deserialize, Deserializer};
use serde_json::{Map, Value};

pub use crate::spec::{ANY_TIME, Configure, FieldVisitor, LINE, SOME_TIME};
pub use kinds::BAUD_RATES;

/// The source of a field that the link's source does not specify.
const OURS: &str = "ours";

/// The form in which values are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// As a user writes them: times as text, such as `250ms` or `never`.
    Text,
    /// As `reference/` has them: times in nanoseconds, never and absent values as `null`, a configuration inside another one
    /// as an object.
    Nanoseconds,
}

/// A setting as `--help` shows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Setting {
    /// The name of the setting; in a TOML file the part before a dot is a table.
    pub name: String,
    /// The unit of a number; otherwise `ns`, `bool`, `word`, `text`, `list`, `object`, or `code` if no value can be given.
    pub unit: &'static str,
    /// The values that the setting accepts; in [`Form::Text`] with their unit.
    pub values: String,
    /// Each accepted value, if they are few: of a choice or a flag.
    pub choices: Vec<Value>,
    /// The value if none is given; an empty text if `values` states the behaviour without a value.
    pub default: Value,
    /// The purpose of the setting.
    pub about: &'static str,
    /// The section of the link's source that specifies the setting, or `ours`.
    pub source: &'static str,
}

impl Setting {
    /// Returns the default in the form in which it is written after `--set NAME=`.
    pub fn default_text(&self) -> String {
        plain(&self.default)
    }
}

/// A refused setting, with the reason.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RefusedSetting {
    /// The name of the setting.
    pub name: String,
    /// The error, and the values to give.
    pub text: String,
}

impl core::fmt::Display for RefusedSetting {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(&self.text)
    }
}

impl core::error::Error for RefusedSetting {}

/// The settings of a configuration, while they are visited.
#[derive(Debug)]
pub struct Table<'a> {
    form: Form,
    prefix: String,
    /// The source of the next setting.
    source: &'static str,
    /// The names of omitted settings that have not been visited yet.
    omitted: Vec<&'static str>,
    visited: Vec<Setting>,
    given: Option<&'a Map<String, Value>>,
    refused: Option<RefusedSetting>,
}

/// Returns a configuration with the given values. `what` names the configured thing in errors.
///
/// # Errors
/// If a name is not a setting of the configuration, or a value is not valid for its setting.
pub fn read<C: Configure>(what: &str, config: C, given: &Map<String, Value>) -> Result<C, RefusedSetting> {
    read_as(Form::Text, what, config, given)
}

/// As [`read`], with values in `form`.
///
/// # Errors
/// If a name is not a setting of the configuration, or a value is not valid for its setting.
pub fn read_as<C: Configure>(
    form: Form,
    what: &str,
    mut config: C,
    given: &Map<String, Value>,
) -> Result<C, RefusedSetting> {
    let Table { visited, refused, .. } = Table::visit_all(form, &mut config, Some(given));
    let names: Vec<&str> = visited.iter().map(|setting| setting.name.as_str()).collect();
    if let Some(unknown) = unknown(given, "", &names) {
        let text = if names.contains(&unknown.as_str()) {
            format!("{unknown} in one name: give what is before a dot as a table")
        } else {
            no_setting(what, &unknown, &names)
        };
        return Err(RefusedSetting { name: unknown, text });
    }
    refused.map_or(Ok(config), Err)
}

/// Returns the error for a name that is not a setting: with the similar names, or with the first of all names if none is
/// similar.
pub fn no_setting(what: &str, name: &str, names: &[impl AsRef<str>]) -> String {
    const LISTED: usize = 12;
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    let within = |known: &&str| known.strip_prefix(name)?.strip_prefix('.').map(str::to_owned);
    let inner: Vec<String> = names.iter().filter_map(within).collect();
    if !inner.is_empty() {
        return format!("{what} has no setting `{name}`: it is a table of {}", inner.join(", "));
    }
    let has = match (did_you_mean(name, &names), names.get(..LISTED)) {
        (similar, _) if !similar.is_empty() => similar,
        _ if names.is_empty() => ": it has no settings".into(),
        (_, Some(first)) if names.len() > LISTED => {
            format!(": it has {}, and {} more", first.join(", "), names.len() - LISTED)
        }
        _ => format!(": it has {}", names.join(", ")),
    };
    format!("{what} has no setting `{name}`{has}")
}

/// Returns the question after an unknown name, such as `` ; did you mean `baud`? ``, or nothing if no name is similar.
///
/// Names are similar by the measure that clap has for arguments. A name without a table is compared with the names in every
/// table, and each name also with the tables.
pub fn did_you_mean(unknown: &str, names: &[&str]) -> String {
    const MIN_SIMILARITY: f64 = 0.75;
    const NEARLY: f64 = 0.05;
    let tables: Vec<&str> =
        names.iter().flat_map(|name| name.match_indices('.').filter_map(|(at, _)| name.get(..at))).collect();
    let (table, last) = table_of(unknown);
    let likeness = |name: &str| match table_of(name) {
        (of, name) if of == table || table.is_empty() => strsim::jaro(last, name),
        _ if tables.contains(&table) => 0.0,
        _ => strsim::jaro(unknown, name),
    };
    let mut found: Vec<(f64, &str)> = Vec::new();
    for name in names.iter().chain(&tables).copied() {
        if likeness(name) > MIN_SIMILARITY && !found.iter().any(|(_, known)| *known == name) {
            found.push((likeness(name), name));
        }
    }
    found.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    let best = found.first().map_or(0.0, |(likeness, _)| *likeness);
    let similar = found.iter().take(2).filter(|(likeness, _)| *likeness > best - NEARLY);
    let quoted: Vec<String> = similar.map(|(_, name)| format!("`{name}`")).collect();
    if quoted.is_empty() { String::new() } else { format!("; did you mean {}?", quoted.join(" or ")) }
}

/// Returns the table of a setting, empty if it is not in a table, and its name in the table.
fn table_of(name: &str) -> (&str, &str) {
    name.rsplit_once('.').unwrap_or(("", name))
}

/// Deserializes a configuration from the values that a user has given: the implementation of
/// [`deserialize!`](crate::deserialize).
///
/// # Errors
/// As [`read`], and the errors of the deserializer.
pub fn deserialize<'de, D: Deserializer<'de>, C: Configure>(
    deserializer: D,
    what: &str,
    config: C,
) -> Result<C, D::Error> {
    read(what, config, &Map::deserialize(deserializer)?).map_err(D::Error::custom)
}

/// Implements `serde::Deserialize` for a configuration that implements [`Configure`]: a field that is not given has the value
/// of the configuration after the comma. Needs the feature `settings`.
#[macro_export]
macro_rules! deserialize {
    ($config:ty, $default:expr) => {
        impl<'de> $crate::settings::Deserialize<'de> for $config {
            fn deserialize<D: $crate::settings::Deserializer<'de>>(
                deserializer: D,
            ) -> Result<Self, D::Error> {
                $crate::settings::deserialize(deserializer, stringify!($config), $default)
            }
        }
    };
}

/// Returns the settings of a configuration, with its values as their defaults.
pub fn list(config: impl Configure) -> Vec<Setting> {
    list_as(Form::Text, config)
}

/// As [`list`], with values in `form`.
pub fn list_as(form: Form, mut config: impl Configure) -> Vec<Setting> {
    Table::visit_all(form, &mut config, None).visited
}

/// Returns the fields of a configuration as `reference/` has them, after the values of `given`, in the same form, were
/// applied.
///
/// # Errors
/// If a name is not a field of the configuration, or a value is not valid for its field.
pub fn fields(config: impl Configure, given: &Map<String, Value>) -> Result<Vec<Setting>, RefusedSetting> {
    let config = read_as(Form::Nanoseconds, "the configuration", config, given)?;
    Ok(list_as(Form::Nanoseconds, config))
}

/// Inserts a value at its name, in tables if the name has dots.
///
/// # Errors
/// If the part before a dot has a value that is not a table.
pub fn insert(settings: &mut Map<String, Value>, name: &str, value: Value) -> Result<(), RefusedSetting> {
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
        other => {
            let text = format!("{name}: `{table}` is {other}, which has no settings in it");
            Err(RefusedSetting { name: name.into(), text })
        }
    }
}

/// Parses the argument of `--set`: a value that is valid JSON is read as JSON, any other as text.
///
/// # Errors
/// If there is no `=`, or no name before it.
pub fn parse(text: &str) -> Result<(String, Value), String> {
    let (name, value) = text.split_once('=').ok_or("give NAME=VALUE")?;
    if name.split('.').any(str::is_empty) {
        return Err("give NAME=VALUE, such as baud=19200".into());
    }
    let value = serde_json::from_str(value).unwrap_or_else(|_| Value::String(value.into()));
    Ok((name.into(), value))
}

impl<'a> Table<'a> {
    fn visit_all(form: Form, config: &mut impl Configure, given: Option<&'a Map<String, Value>>) -> Self {
        let (prefix, source, omitted, visited) = (String::new(), OURS, Vec::new(), Vec::new());
        let mut table = Self { form, prefix, source, omitted, visited, given, refused: None };
        config.configure(&mut table);
        table
    }

    /// Visits a setting: `set` gets the value if one is given, and returns the reason to refuse it.
    fn visit(
        &mut self,
        name: &str,
        unit: &'static str,
        (values, choices): (String, Vec<Value>),
        default: Value,
        about: &'static str,
        set: &mut dyn FnMut(&Value) -> Result<(), Cow<'static, str>>,
    ) {
        let source = self.take_source();
        if !self.is_visited(name) {
            return;
        }
        let name = format!("{}{name}", self.prefix);
        if let Some(value) = self.given.and_then(|given| find(given, &name))
            && let Err(why) = set(value)
        {
            let text = format!("{name}={}: {why}, give {values}", plain(value));
            self.refused.get_or_insert_with(|| RefusedSetting { name: name.clone(), text });
        }
        self.visited.push(Setting { name, unit, values, choices, default, about, source });
    }

    /// Returns whether a setting is not omitted.
    fn is_visited(&mut self, name: &str) -> bool {
        let omitted = self.omitted.iter().position(|omitted| *omitted == name);
        omitted.map(|place| self.omitted.remove(place)).is_none()
    }

    fn take_source(&mut self) -> &'static str {
        core::mem::replace(&mut self.source, OURS)
    }
}

/// Returns the value of a name, in tables if the name has dots.
fn find<'a>(given: &'a Map<String, Value>, name: &str) -> Option<&'a Value> {
    match name.split_once('.') {
        None => given.get(name),
        Some((table, rest)) => find(given.get(table)?.as_object()?, rest),
    }
}

/// Returns the first name that is not one of `names`, nor in the table of one, or that has a dot: a table must be given
/// instead.
fn unknown(given: &Map<String, Value>, prefix: &str, names: &[&str]) -> Option<String> {
    given.iter().find_map(|(key, value)| {
        let name = format!("{prefix}{key}");
        if key.contains('.') {
            return Some(name);
        }
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

fn merge(before: &mut Map<String, Value>, after: Map<String, Value>) -> Result<(), RefusedSetting> {
    after.into_iter().try_for_each(|(name, value)| insert(before, &name, value))
}

/// Returns a value as it is written after `--set NAME=`.
fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}
