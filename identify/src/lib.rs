#![doc = include_str!("../README.md")]
//!
//! Each combination of settings is judged by reading the bytes with it. A message counts whole if the encoder writes the
//! same bytes again, and half if it writes others. Of two combinations, the one that explains more bytes is chosen; the
//! other is ruled out if the bytes that it leaves unexplained are too many to be corruption (see `evidence`). The remaining
//! values of a setting are undecided: the finding lists them, with the bytes that they explain less, and a message that
//! would decide. Values that make no sense (a position of 10⁻⁴¹ mm) decide only if the bytes do not.
#![forbid(unsafe_code)]
#![allow(clippy::std_instead_of_core, reason = "for programs with std")]

mod combination;
mod draft;
mod echo;
mod evidence;
mod plausible;
mod search;
#[cfg(test)]
mod tests;
pub mod unknown;

use std::time::Duration;

use serde_json::{Map, Value};

use cellwire_links::link::Link;

pub use draft::{draft, toml_text};
pub use search::identify;

/// The bytes that one end sent.
#[derive(Debug, Clone)]
pub struct Stream {
    /// The known facts about the sender.
    pub sender: Sender,
    /// The bytes of the stream; between two parts some are missing.
    pub parts: Vec<Vec<u8>>,
    /// The offsets and times of arrivals: the byte, counted over all parts, at which a packet or the bytes of one read
    /// begin. May be empty.
    pub arrivals: Vec<(usize, Duration)>,
}

/// The known facts about a sender.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Sender {
    /// Nothing, or both ends on one line.
    Unknown,
    /// The name of the sender, if a link has a side of that name.
    Named(String),
    /// The other end than the one of this name.
    Other(String),
    /// The end at which a line was recorded, or the other one.
    Kept {
        /// Whether the bytes were sent by the end that recorded the line.
        by_keeper: bool,
    },
    /// The likely end of a connection, and the server's port.
    Connected {
        /// Whether the sender seems to have opened the connection.
        is_client: bool,
        /// The TCP port of the server.
        port: u16,
    },
    /// The bytes that a trace of the tool lists as sent, or as received.
    Traced {
        /// The name of the trace.
        name: String,
        /// Whether the bytes were sent by the end that kept the trace.
        sent: bool,
    },
}

/// How a link explains bytes, with the settings that explain most.
#[derive(Debug, Clone)]
pub struct Finding {
    /// The link that explains the bytes.
    pub link: &'static Link,
    /// The settings, those that are undecided at the value that is likelier or the default.
    pub settings: Map<String, Value>,
    /// The settings that the source leaves open, one by one.
    pub options: Vec<OpenSetting>,
    /// The number of messages that were read, and the number of them that are written as they were read.
    pub messages: [usize; 2],
    /// The bytes in messages, and all of them.
    pub bytes: [u64; 2],
    /// The certainty that these are messages: chance explains as much once in 2 to the power of this.
    pub bits: f64,
    /// The sides that sent each stream.
    pub senders: Vec<Vec<&'static str>>,
    /// The messages that were read, stream by stream.
    pub read: Vec<(&'static str, Value)>,
}

impl Finding {
    /// The number of bits below which messages may have been read by chance.
    pub const SURE: f64 = 20.0;
    /// Below this share of the bytes, another protocol explains most of them. If one byte of a hundred is corrupt, a third
    /// of the messages of a hundred bytes remains, and of a few messages less.
    pub const SHARE: f64 = 0.1;

    /// Returns the share of the bytes within messages.
    pub fn share(&self) -> f64 {
        let [explained, all] = self.bytes.map(|bytes| u32::try_from(bytes).map_or(f64::MAX, f64::from));
        if all > 0.0 { explained / all } else { 0.0 }
    }

    /// Returns the measure by which links are compared: the share of explained bytes, and its certainty.
    pub fn rank(&self) -> f64 {
        self.share() * self.bits.min(100.0)
    }

    /// Returns whether the bytes were not read by chance.
    pub fn is_sure(&self) -> bool {
        self.bits >= Self::SURE && self.share() >= Self::SHARE
    }
}

/// A setting that the source leaves open.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenSetting {
    /// The name of the setting.
    pub name: String,
    /// The value that explains the bytes.
    pub value: Value,
    /// The evidence for the value.
    pub decided: DecidedBy,
}

/// The evidence for the value of a setting.
#[derive(Debug, Clone, PartialEq)]
pub enum DecidedBy {
    /// Every other value leaves messages unexplained.
    ByBytes,
    /// Other values give numbers or texts that make no sense.
    ByValues,
    /// The bytes do not decide the setting.
    Not {
        /// The other values that are not ruled out; empty if any value explains the same.
        others: Vec<OtherValue>,
        /// A message that would decide it; `None` if the setting makes no difference beside the others.
        message: Option<String>,
    },
}

/// A value of a setting that is not ruled out.
#[derive(Debug, Clone, PartialEq)]
pub struct OtherValue {
    /// The value that is not ruled out.
    pub value: Value,
    /// The number of bytes that the value leaves unexplained, and the chosen value explains.
    pub fewer: u64,
    /// The bytes that it explains, but would write otherwise; the chosen value writes them as they were read.
    pub inexact: u64,
}
