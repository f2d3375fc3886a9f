//! The fields of a configuration that a story sets.

use core::time::Duration;

use anyhow::{Result, bail};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// Those that nobody has taken yet.
pub(crate) struct Fields(pub(crate) Map<String, Value>);

impl Fields {
    pub(crate) fn take<T: DeserializeOwned>(&mut self, name: &str, field: &mut T) -> Result<()> {
        if let Some(value) = self.0.remove(name) {
            *field = serde_json::from_value(value)?;
        }
        Ok(())
    }

    /// A time in nanoseconds; `null` is for ever.
    pub(crate) fn time(&mut self, name: &str, field: &mut Duration) -> Result<()> {
        if let Some(value) = self.0.remove(name) {
            let nanoseconds: Option<u64> = serde_json::from_value(value)?;
            *field = nanoseconds.map_or(Duration::MAX, Duration::from_nanos);
        }
        Ok(())
    }

    pub(crate) fn end(self) -> Result<()> {
        match self.0.keys().next() {
            Some(name) => bail!("the configuration has no field {name}"),
            None => Ok(()),
        }
    }
}
