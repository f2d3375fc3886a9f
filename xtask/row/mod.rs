//! toy-link: its row of the table, and its codec.

use anyhow::Result;
use serde_json::{Map, Value};
use toy_link::robot_session::Encode as _;
use toy_link::{Decoder, Message};

use crate::codec::{Codec, Kind, Messages, codec, message};
use crate::link::Link;
use crate::settings;

/// The link.
pub const LINK: Link = Link {
    name: "toy-link",
    about: "A link of lines",
    sides: &["host", "device"],
    sender: |is_client, _server_port| if is_client { "host" } else { "device" },
    traces: &[],
    settings: || settings::list(()),
    codec: either,
};

/// Both sides write lines.
fn either(_side: &str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    settings::read("toy-link", (), settings)?;
    Ok(codec(Decoder::new(), Lines))
}

struct Lines;

impl Messages for Lines {
    type Decoder = Decoder;

    fn show(&self, line: Message, json: &mut Vec<u8>) -> Kind {
        message(&line, json)
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>> {
        let message: Message = serde_json::from_value(message)?;
        let mut line = vec![0; message.encoded_len()];
        message.encode(&mut line)?;
        Ok(line)
    }
}
