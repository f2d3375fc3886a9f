//! Both ends of Modbus. A copy of each machine is given what the session gives to its own, and must stay equal to it: so the cells
//! of frames, of outcomes and of the timer are known that a session does not show.

mod client;
mod server;

use core::time::Duration;

use anyhow::{Result, bail};
use fanuc_hmi_modbus::{Framing, Line, timing};

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

/// How the matrix begins the names of its states.
fn prefix(framing: Framing) -> &'static str {
    match framing {
        Framing::Tcp => "TCP",
        Framing::Rtu { .. } => "RTU",
        Framing::RtuOverTcp { .. } => "RTU over TCP",
    }
}

/// What the matrix calls an input that comes before a time, or at it; both, where there is no time.
fn timed(due: Option<Duration>, now: Duration, before: &'static str, at: &'static str) -> Vec<&'static str> {
    match due {
        None => vec![before, at],
        Some(due) if now < due => vec![before],
        Some(_) => vec![at],
    }
}

/// When the line is silent.
fn silent_at(line: Line) -> Option<Duration> {
    match line {
        Line::Silent => None,
        Line::Busy { silent_at } => Some(silent_at),
    }
}
