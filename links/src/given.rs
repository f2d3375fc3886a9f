//! The configuration of an end as a story has it.

use anyhow::Result;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use crate::settings::{Configure, Form, read_as};

/// The given fields of a configuration, and of the parts beside the end: those that differ from the defaults.
pub(crate) struct GivenFields(pub(crate) Map<String, Value>);

impl GivenFields {
    /// Removes and returns a value that is not a field of the configuration, such as the length of a queue.
    pub(crate) fn take<T: DeserializeOwned>(&mut self, name: &str) -> Result<Option<T>> {
        Ok(self.0.remove(name).map(|value| T::deserialize(&value)).transpose()?)
    }

    /// Applies all remaining values to a configuration; times are in nanoseconds.
    pub(crate) fn configure<C: Configure>(self, config: C) -> Result<C> {
        Ok(read_as(Form::Nanoseconds, "the configuration", config, &self.0)?)
    }
}
