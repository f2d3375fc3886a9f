//! The settings of the link.

use anyhow::{Result, bail};
use fanuc_hmi_modbus::{Framing, WordOrder};
use serde_json::Value;

use crate::links::settings::Settings;

/// The setting `framing`: `tcp`, the default, or `rtu`.
pub fn is_rtu(settings: &Settings<'_>) -> Result<bool> {
    match settings.text("framing")? {
        None | Some("tcp") => Ok(false),
        Some("rtu") => Ok(true),
        Some(other) => bail!("framing={other} is neither tcp nor rtu"),
    }
}

/// The framing of the setting `framing`: RTU frames go through a TCP connection.
///
/// # Errors
/// When it is another text.
pub fn framing(settings: &Settings<'_>) -> Result<Framing> {
    Ok(if is_rtu(settings)? { Framing::RTU_OVER_TCP } else { Framing::Tcp })
}

/// The setting `word_order`: `low_first`, the default, or `high_first`.
pub fn word_order(settings: &Settings<'_>) -> Result<WordOrder> {
    match settings.text("word_order")? {
        None | Some("low_first") => Ok(WordOrder::LowFirst),
        Some("high_first") => Ok(WordOrder::HighFirst),
        Some(other) => bail!("word_order={other} is neither low_first nor high_first"),
    }
}

/// A value that is only ever made of numbers and names.
pub fn json(value: impl serde::Serialize) -> Value {
    serde_json::to_value(value).unwrap_or_default()
}
