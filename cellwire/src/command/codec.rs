//! The arguments of `decode` and `encode`.

use anyhow::Result;
use serde_json::{Map, Value};

use super::settings::SetArgs;
use crate::devices::link_parser;
use cellwire_links::LINKS;
use cellwire_links::codec::{Codec, Stream};
use cellwire_links::link::Link;
use cellwire_links::shadow::{Setup, Watcher};

/// The bytes to read or write.
#[derive(Debug, clap::Args)]
pub(super) struct CodecArgs {
    #[command(flatten)]
    pub(super) of: LinkArgs,
    #[arg(long, value_name = "SIDE", help = sides())]
    pub(super) from: Option<String>,
}

/// The link whose bytes they are.
#[derive(Debug, clap::Args)]
pub(super) struct LinkArgs {
    /// The link, or its crate's name
    #[arg(value_parser = link_parser())]
    pub(super) link: &'static Link,
    #[command(flatten)]
    set: SetArgs,
}

/// Returns the help of `--from`.
fn sides() -> String {
    let sides = |link: &Link| format!("{}: {}", link.short, link.sides.join(" or "));
    let all = LINKS.iter().map(sides).collect::<Vec<_>>().join("; ");
    format!("The side that sends the bytes: {all} [default: the first]")
}

impl CodecArgs {
    /// Returns the codec of the sending side.
    ///
    /// # Errors
    /// When the link has no such side or setting.
    pub(super) fn codec(&self) -> Result<Box<dyn Codec>> {
        self.of.codec_of(self.side()?)
    }

    /// Returns the sending side.
    ///
    /// # Errors
    /// When the link has no such side.
    pub(super) fn side(&self) -> Result<&'static str> {
        self.of.link.side(self.from.as_deref())
    }
}

impl LinkArgs {
    /// Returns the settings of the codec.
    ///
    /// # Errors
    /// When the file of settings cannot be read.
    pub(super) fn settings(&self) -> Result<Map<String, Value>> {
        self.set.read(&(self.link.settings)())
    }

    /// Returns the codec of a side.
    ///
    /// # Errors
    /// When the link has no such setting.
    pub(super) fn codec_of(&self, side: &'static str) -> Result<Box<dyn Codec>> {
        (self.link.codec)(side, &self.settings()?)
    }

    /// Returns a stream of a side's bytes from this offset on, without flow control.
    ///
    /// # Errors
    /// When the link has no such setting.
    pub(super) fn stream_of(&self, side: &'static str, begin: u64) -> Result<Stream> {
        Ok(Stream::starting_at(self.codec_of(side)?, begin).without(self.link.flow_control))
    }

    /// Returns a watcher of a conversation of both ends: over a serial line or not, at this rate if it is known.
    ///
    /// # Errors
    /// When the link has no such setting.
    pub(super) fn watcher(&self, baud: Option<u32>, is_serial: bool) -> Result<Watcher> {
        let (settings, configs) = (self.settings()?, Map::new());
        let setup = Setup { settings: &settings, configs: &configs, baud, is_serial };
        let shadow = (self.link.shadow)(&setup)?;
        Ok(Watcher::new(shadow))
    }

    /// Returns the end that sends no messages, and polls.
    pub(super) fn poller(&self) -> Option<&'static str> {
        let end = self.link.ends.iter().find(|end| !self.link.sides.contains(&end.name));
        end.filter(|_| self.link.sides.len() == 1).map(|end| end.name)
    }
}
