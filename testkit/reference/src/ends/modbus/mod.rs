//! Both ends of Modbus.

mod client;
mod server;

use core::time::Duration;

use anyhow::{Result, bail};
use fanuc_hmi_modbus::{Framing, timing};

use super::Fields;

pub(super) use client::MAKER as CLIENT;
pub(super) use server::MAKER as SERVER;

/// The transport of a configuration, and the baud rate of its line.
struct Transport {
    word: String,
    baud: u32,
    silence: Option<Duration>,
}

impl Transport {
    fn take(fields: &mut Fields) -> Result<Self> {
        let mut transport = Self { word: "tcp".into(), baud: 19_200, silence: None };
        fields.take("framing", &mut transport.word)?;
        fields.take("baud", &mut transport.baud)?;
        let mut silence = Duration::ZERO;
        let name = if transport.word == "rtu" { "silence" } else { "stall" };
        if fields.0.contains_key(name) {
            fields.time(name, &mut silence)?;
            transport.silence = Some(silence);
        }
        Ok(transport)
    }

    fn framing(&self) -> Result<Framing> {
        Ok(match (self.word.as_str(), self.silence) {
            ("tcp", None) => Framing::Tcp,
            ("rtu", silence) => {
                Framing::Rtu { silence: silence.unwrap_or_else(|| timing::silence(self.baud)) }
            }
            ("rtu_over_tcp", None) => Framing::RTU_OVER_TCP,
            ("rtu_over_tcp", Some(stall)) => Framing::RtuOverTcp { stall },
            (word, _) => bail!("no framing {word}, or none with this field"),
        })
    }
}

/// How many places an end has.
fn places(fields: &mut Fields) -> Result<usize> {
    let mut places = 8;
    fields.take("places", &mut places)?;
    Ok(places)
}
