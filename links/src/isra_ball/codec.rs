use anyhow::Result;
use isra_ball::{Decoder, Frame, Packet};
use robot_session::Encode as _;
use serde_json::{Map, Value};

use crate::codec::{Codec, EncodeError, Kind, Messages, bytes, codec, message, read};
use crate::settings;

/// Returns the codec of the ball's messages. The host's ENQ is one byte and not a message.
///
/// # Errors
/// If a setting is given, since the link has no settings.
pub(super) fn ball(settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    settings::read("ball", (), settings)?;
    Ok(codec(Decoder::new(), Ball))
}

struct Ball;

impl Messages for Ball {
    type Decoder = Decoder;

    fn show(&self, frame: Frame<'_>, json: &mut Vec<u8>) -> Kind {
        message(&frame, json)
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>, EncodeError> {
        let packet: Packet = read(message)?;
        bytes(packet.encoded_len(), |out| packet.encode(out))
    }

    #[cfg(feature = "arbitrary")]
    fn arbitrary(&self, u: &mut arbitrary::Unstructured<'_>) -> arbitrary::Result<Value> {
        crate::codec::object(&u.arbitrary::<Packet>()?)
    }
}
