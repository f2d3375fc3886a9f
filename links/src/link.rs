//! A row of the table.

use anyhow::{Context, Result, bail};
use serde_json::{Map, Value};

use crate::LINKS;
use crate::codec::Codec;
use crate::end::EndRow;
use crate::parts::{Part, ReadMessage};
use crate::settings::{RefusedSetting, Setting, did_you_mean};
#[cfg(feature = "captures")]
use crate::shadow::MakeShadow;

/// A link.
#[derive(Debug, Clone, Copy)]
pub struct Link {
    /// The name of the link's crate.
    pub name: &'static str,
    /// The name of the link in commands.
    pub short: &'static str,
    /// The link in one line.
    pub about: &'static str,
    /// The names of the sides that send messages; the first is the default.
    pub sides: &'static [&'static str],
    /// The side that sends, in a capture: the TCP client, or the server on this port; `None`: an end that sends no messages,
    /// and polls.
    pub sender: fn(is_client: bool, server_port: u16) -> Option<&'static str>,
    /// The traces of the tool by name: the sides that sent the bytes which the trace lists as sent and as received. `None` for a
    /// side that sends no messages.
    pub traces: &'static [(&'static str, [Option<&'static str>; 2])],
    /// Whether a mark shows the beginning of a frame: if not, a truncated frame takes the next one with it.
    pub marks_begin: bool,
    /// The two bytes that stop the line and restart it, at any position: a session removes them before its decoder gets the
    /// bytes. `None` without flow control.
    pub flow_control: Option<[u8; 2]>,
    /// The configurations of its crate.
    pub configs: &'static [Config],
    /// Returns the settings of the codec, with the defaults.
    pub settings: fn() -> Vec<Setting>,
    /// The codec of a side's messages, with settings other than the defaults, as in the vectors' `options`:
    /// `{"framing":"rtu"}`.
    pub codec: MakeCodec,
    /// Whether its decoder may accept bytes that its encoder would write differently, or not at all; all other messages have
    /// one form.
    pub tolerates: fn(&AcceptedMessage<'_>) -> bool,
    /// The kinds of its decoders' errors, and the clause of its specification that such bytes break.
    pub clauses: &'static [(&'static str, &'static str)],
    /// Returns the parts of a message: the bytes of each value, and the clause that describes it.
    pub parts: fn(&ReadMessage<'_>) -> Vec<Part>,
    /// The properties of the bytes that the source leaves open.
    #[cfg(feature = "captures")]
    pub open: OpenSettings,
    /// Makes a shadow, which observes a conversation of both ends.
    #[cfg(feature = "captures")]
    pub shadow: MakeShadow,
    /// The ends; the requesting one comes first.
    pub ends: &'static [EndRow],
}

/// The fields of a configuration, or why one that was given is refused.
pub type ListResult = Result<Vec<Setting>, RefusedSetting>;

/// A configuration.
#[derive(Debug, Clone, Copy)]
pub struct Config {
    /// The name of its type.
    pub name: &'static str,
    /// The fields of the default, or of the default with these values, in the form of `reference/`.
    pub fields: fn(given: &Map<String, Value>) -> ListResult,
}

/// The properties of a link's bytes that its source leaves open, and that a capture may decide.
#[derive(Debug, Clone, Copy)]
pub struct OpenSettings {
    /// The settings of the codec that bytes decide.
    pub settings: &'static [&'static str],
    /// Other settings that affect the view of the bytes, with their values: `view`, `telemetry`.
    pub beside: &'static [(&'static str, &'static str)],
    /// Other settings of the ends, which bytes show and a command may lack: their values in these messages, and the reason
    /// for each.
    pub places: fn(messages: &[(&'static str, Value)]) -> Vec<ShownSetting>,
    /// The names of the settings of [`places`](Self::places).
    pub place_names: &'static [&'static str],
    /// The setting that has too many values to try all; `None` without one.
    pub guess: Option<Guess>,
    /// Messages whose bytes differ from setting to setting.
    pub deciding: &'static [DecidingMessage],
    /// Values with which more is read, and the same is written: the setting, the value, and which bytes would decide.
    pub reads_more: &'static [(&'static str, &'static str, &'static str)],
    /// The settings of the codec as a function that returns the crate's configuration, with all necessary definitions.
    pub rust: fn(&Map<String, Value>, Carrier) -> Result<String>,
    /// Returns the information that a message contributes after the previous one of the same side, in bits.
    pub sense: fn(before: &Value, message: &Value) -> f64,
    /// Returns further observations about the messages, each of which has its side; one line each.
    pub notes: fn(messages: &[(&'static str, Value)]) -> Vec<String>,
}

/// A setting of an end that messages show: its name, its value, and the reason.
pub type ShownSetting = (&'static str, u64, &'static str);

/// The transport of a capture's bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Carrier {
    /// The capture does not show the carrier.
    #[default]
    Unknown,
    /// A TCP connection or UDP datagrams.
    Network,
    /// A serial line, with its rate in baud if that is known; `None` otherwise.
    Serial(Option<u32>),
}

/// The values of a setting that bytes suggest.
#[derive(Debug, Clone, Copy)]
pub struct Guess {
    /// The name of the setting.
    pub setting: &'static str,
    /// The settings that must be known for it.
    pub with: &'static [&'static str],
    /// The values that explain most of these streams, the best first.
    pub values: GuessValues,
}

/// A message that decides settings.
#[derive(Debug, Clone, Copy)]
pub struct DecidingMessage {
    /// The side that sends it.
    pub side: &'static str,
    /// A description of the message.
    pub about: &'static str,
    /// The object of the message, as JSON.
    pub message: &'static str,
}

impl OpenSettings {
    /// Nothing.
    pub const NOTHING: Self = Self {
        settings: &[],
        beside: &[],
        places: |_| Vec::new(),
        place_names: &[],
        guess: None,
        deciding: &[],
        reads_more: &[],
        rust: |_, _| Ok(String::new()),
        sense: |_, _| 0.0,
        notes: |_| Vec::new(),
    };
}

/// A message that was accepted, and is not written as it was read.
#[derive(Debug, Clone, Copy)]
pub struct AcceptedMessage<'a> {
    /// The settings of the codec.
    pub settings: &'a Map<String, Value>,
    /// The message as its codec shows it.
    pub message: &'a Value,
    /// The bytes that were read.
    pub bytes: &'a [u8],
    /// The bytes that the encoder writes; `None` if it refuses the message.
    pub written: Option<&'a [u8]>,
}

/// The values that explain most of some streams, with these settings.
type GuessValues = fn(given: &Map<String, Value>, streams: &[&[u8]]) -> Vec<Value>;

/// Makes the codec of a side.
type MakeCodec = fn(side: &str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>>;

impl Link {
    /// Returns the link with this name, or whose crate has this name.
    ///
    /// # Errors
    /// If there is no such link.
    pub fn by_name(name: &str) -> Result<&'static Self> {
        LINKS.iter().find(|link| [link.short, link.name].contains(&name)).with_context(|| {
            let names: Vec<&str> = LINKS.iter().map(|link| link.short).collect();
            let meant = did_you_mean(name, &names);
            format!("no link is called {name}; the links are {}{meant}", names.join(", "))
        })
    }

    /// Returns an end by its name.
    ///
    /// # Errors
    /// If the link has no such end.
    pub fn end(&self, name: &str) -> Result<&'static EndRow> {
        let end = self.ends.iter().find(|end| end.name == name);
        end.with_context(|| format!("{} has no end `{name}`", self.name))
    }

    /// Returns the side that sent the bytes that a recording lists as sent (`by_keeper`) or as received. `kept` is the recording
    /// end; without it, the side `pc` if the link has one, otherwise the client.
    ///
    /// # Errors
    /// If the link has no such side.
    pub fn keeper(&self, kept: Option<&str>, by_keeper: bool) -> Result<Option<&'static str>> {
        let sides = match kept {
            Some(_) => {
                let keeper = self.side(kept)?;
                [Some(keeper), self.sides.iter().find(|side| **side != keeper).copied()]
            }
            None => {
                let is_pc = |side: &Option<&str>| *side == Some("pc");
                let mut sides = [true, false].map(|is_client| (self.sender)(is_client, 0));
                if sides.last().is_some_and(is_pc) {
                    sides.reverse();
                }
                sides
            }
        };
        let [keeper, other] = sides;
        Ok(if by_keeper { keeper } else { other })
    }

    /// Returns the side that sent the bytes that a trace of this name lists as sent (`by_keeper`), or as received. `None` if
    /// this link has no such trace; the inner `None` if that end sends no messages.
    pub fn traced(&self, name: &str, by_keeper: bool) -> Option<Option<&'static str>> {
        let (_, [sent, received]) = self.traces.iter().find(|(known, _)| *known == name)?;
        Some(if by_keeper { *sent } else { *received })
    }

    /// Returns the clause of the specification that bytes with this kind of error break.
    pub fn clause(&self, kind: &str) -> Option<&'static str> {
        self.clauses.iter().find(|(known, _)| *known == kind).map(|(_, clause)| *clause)
    }

    /// Returns whether an accepted message is written by its codec as it was read, or is allowed to differ.
    pub fn accepts(&self, accepted: &AcceptedMessage<'_>) -> bool {
        accepted.written == Some(accepted.bytes) || (self.tolerates)(accepted)
    }

    /// Returns a side by its name, or the first.
    ///
    /// # Errors
    /// If the link has no such side.
    pub fn side(&self, from: Option<&str>) -> Result<&'static str> {
        match self.sides.iter().find(|side| from.is_none_or(|from| **side == from)) {
            Some(side) => Ok(side),
            None => bail!(
                "{} has no side `{}`: use --from {}",
                self.name,
                from.unwrap_or_default(),
                self.sides.join(" or --from ")
            ),
        }
    }
}
