//! The configuration of an end as a story has it.

use anyhow::Result;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use crate::settings::{Configure, Form, read_as};

/// What is given of a configuration, and of what is beside the end: fields whose defaults are others.
pub(crate) struct Given(pub(crate) Map<String, Value>);

impl Given {
    /// What is no field of the configuration: how long a queue is, for example.
    pub(crate) fn take<T: DeserializeOwned>(&mut self, name: &str) -> Result<Option<T>> {
        Ok(self.0.remove(name).map(|value| T::deserialize(&value)).transpose()?)
    }

    /// The configuration with everything that is left; times are nanoseconds.
    pub(crate) fn configure<C: Configure>(self, config: C) -> Result<C> {
        Ok(read_as(Form::Nanoseconds, "the configuration", config, &self.0)?)
    }
}
