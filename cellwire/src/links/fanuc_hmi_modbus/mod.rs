//! fanuc-hmi-modbus in the tool: its codec, the simulated controller, and a client for scripts.

pub mod client;
mod codec;
pub mod controller;
mod demo;
pub mod logger;
pub mod plot;
pub mod recording;
mod robot;
pub mod simulate;

use anyhow::{Result, bail};
use fanuc_hmi_modbus::Framing;
use serde_json::Value;

use crate::settings::Settings;

pub use codec::codec;
pub use demo::demo;

/// The setting `framing`: `tcp`, the default, or `rtu`.
fn is_rtu(settings: &Settings<'_>) -> Result<bool> {
    match settings.text("framing")? {
        None | Some("tcp") => Ok(false),
        Some("rtu") => Ok(true),
        Some(other) => bail!("framing={other} is neither tcp nor rtu"),
    }
}

fn framing(settings: &Settings<'_>) -> Result<Framing> {
    Ok(if is_rtu(settings)? { Framing::RTU_OVER_TCP } else { Framing::Tcp })
}

/// A value that is only ever made of numbers and names.
fn json(value: impl serde::Serialize) -> Value {
    serde_json::to_value(value).unwrap_or_default()
}
