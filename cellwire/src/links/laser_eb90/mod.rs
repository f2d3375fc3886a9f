//! laser-eb90 in the tool: its codec, the simulated controller, and a sheet to cut.

mod codec;
pub mod controller;
mod demo;
pub mod host;
pub mod path;
pub mod tally;

pub use codec::codec;
pub use demo::demo;

use anyhow::{Context, Result};
use laser_eb90::Profile;
use serde_json::{Map, Value};

/// A profile from settings: its fields by name, such as `tail=etx`.
///
/// # Errors
/// When a name is no field of `Profile`, or a value is none of the field's.
pub fn profile(settings: &Map<String, Value>) -> Result<Profile> {
    serde_json::from_value(Value::Object(settings.clone())).context("a setting of laser-eb90")
}
