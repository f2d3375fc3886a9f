//! `--set NAME=VALUE`: settings of a link or a device that differ from its defaults.

use core::fmt::Display;
use core::ops::RangeInclusive;

use anyhow::{Context, Result, bail, ensure};
use serde_json::{Map, Value};

use crate::io::serial::BAUD_RATES;

/// Settings whose names are all known.
#[derive(Debug, Clone, Copy)]
pub struct Settings<'a> {
    values: &'a Map<String, Value>,
}

impl<'a> Settings<'a> {
    /// The settings of `what`, which has settings of these names.
    ///
    /// # Errors
    /// When a name is not among them.
    pub fn new(what: &str, values: &'a Map<String, Value>, known: &[&str]) -> Result<Self> {
        match values.keys().find(|name| !known.contains(&name.as_str())) {
            None => Ok(Self { values }),
            Some(name) if known.is_empty() => bail!("{what} has no setting `{name}`: it has no settings"),
            Some(name) => bail!("{what} has no setting `{name}`: it has {}", known.join(", ")),
        }
    }

    /// A whole number.
    ///
    /// # Errors
    /// When the value is not a whole number, or is outside the range of `T`.
    pub fn number<T: TryFrom<i64>>(&self, name: &str, default: T) -> Result<T> {
        let Some(value) = self.values.get(name) else { return Ok(default) };
        let number = value.as_i64().and_then(|number| T::try_from(number).ok());
        number.with_context(|| format!("{name}={value} is not a number in its range"))
    }

    /// A whole number within `range`.
    ///
    /// # Errors
    /// When the value is not a whole number, or is outside the range.
    pub fn number_in<T>(&self, name: &str, default: T, range: RangeInclusive<T>) -> Result<T>
    where
        T: TryFrom<i64> + PartialOrd + Display,
    {
        let number = self.number(name, default)?;
        let (least, most) = (range.start(), range.end());
        ensure!(range.contains(&number), "{name}={number} is not in {least}..={most}");
        Ok(number)
    }

    /// The setting `baud`.
    ///
    /// # Errors
    /// When the value is not a permitted baud rate.
    pub fn baud(&self, default: u32) -> Result<u32> {
        self.number_in("baud", default, BAUD_RATES)
    }

    /// `true` or `false`.
    ///
    /// # Errors
    /// When the value is neither.
    pub fn flag(&self, name: &str, default: bool) -> Result<bool> {
        let Some(value) = self.values.get(name) else { return Ok(default) };
        value.as_bool().with_context(|| format!("{name}={value} is neither true nor false"))
    }

    /// A text.
    ///
    /// # Errors
    /// When the value is not a text.
    pub fn text(&self, name: &str) -> Result<Option<&'a str>> {
        let Some(value) = self.values.get(name) else { return Ok(None) };
        value.as_str().map(Some).with_context(|| format!("{name}={value} is not a text"))
    }
}

/// The parser of `--set`: a value that is valid JSON is read as JSON, any other as text.
///
/// # Errors
/// When there is no `=`.
pub fn parse(text: &str) -> Result<(String, Value), String> {
    let (name, value) = text.split_once('=').ok_or("give NAME=VALUE")?;
    let value = serde_json::from_str(value).unwrap_or_else(|_| Value::String(value.into()));
    Ok((name.into(), value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_settings_and_values_out_of_range_are_refused() {
        let values = Map::from_iter(["baud=19200", "mode=300", "clamp=on"].map(|s| parse(s).unwrap()));
        let settings = Settings::new("puma", &values, &["baud", "mode", "clamp"]).unwrap();
        assert_eq!(settings.baud(38_400).unwrap(), 19_200);
        let error = settings.number_in("baud", 9600, 300..=9600).unwrap_err();
        assert_eq!(error.to_string(), "baud=19200 is not in 300..=9600");
        assert_eq!(settings.number("absent", 7u8).unwrap(), 7);
        let error = settings.number("mode", 0u8).unwrap_err();
        assert_eq!(error.to_string(), "mode=300 is not a number in its range");
        assert_eq!(
            settings.flag("clamp", true).unwrap_err().to_string(),
            "clamp=\"on\" is neither true nor false"
        );
        assert!(settings.flag("absent", true).unwrap());
        let error = Settings::new("puma", &values, &["baud", "mode"]).unwrap_err();
        assert_eq!(error.to_string(), "puma has no setting `clamp`: it has baud, mode");
    }
}
