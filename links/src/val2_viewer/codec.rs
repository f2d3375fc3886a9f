use anyhow::Result;
use robot_session::Encode as _;
use serde_json::{Map, Value};
use val2_viewer::{Decoder, PosePacket};

use crate::codec::{Codec, Kind, Messages, codec, message};
use crate::settings;

/// What the host sends. The workstation's ENQ is one byte and no message.
///
/// # Errors
/// When a setting is given: the link has none.
pub(super) fn host(settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    settings::read("val2-viewer", (), settings)?;
    Ok(codec(Decoder::new(), Host))
}

struct Host;

impl Messages for Host {
    type Decoder = Decoder;

    fn show(&self, packet: PosePacket, json: &mut Vec<u8>) -> Kind {
        message(&packet, json)
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>> {
        let packet: PosePacket = serde_json::from_value(message)?;
        let mut bytes = vec![0; packet.encoded_len()];
        packet.encode(&mut bytes)?;
        Ok(bytes)
    }
}
