use anyhow::Result;
use robot_session::Encode as _;
use serde_json::{Map, Value};
use val2_viewer::{Decoder, PosePacket};

use crate::codec::{Codec, EncodeError, Kind, Messages, bytes, codec, message, read};
use crate::settings;

/// Returns the codec of the host's messages. The workstation's ENQ is one byte and not a message.
///
/// # Errors
/// If a setting is given, since the link has no settings.
pub(super) fn host(settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    settings::read("viewer", (), settings)?;
    Ok(codec(Decoder::new(), Host))
}

struct Host;

impl Messages for Host {
    type Decoder = Decoder;

    fn show(&self, packet: PosePacket, json: &mut Vec<u8>) -> Kind {
        message(&packet, json)
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>, EncodeError> {
        let packet: PosePacket = read(message)?;
        bytes(packet.encoded_len(), |out| packet.encode(out))
    }

    #[cfg(feature = "arbitrary")]
    fn arbitrary(&self, u: &mut arbitrary::Unstructured<'_>) -> arbitrary::Result<Value> {
        crate::codec::object(&u.arbitrary::<PosePacket>()?)
    }
}
