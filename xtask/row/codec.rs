use anyhow::Result;
use robot_session::Encode as _;
use serde_json::{Map, Value};
use toy_link::{Decoder, Message};

use crate::codec::{Codec, EncodeError, Kind, Messages, bytes, codec, message, read};
use crate::settings;

/// Creates the codec of either side: both write lines.
///
/// # Errors
/// A setting is given: the link has no settings.
pub(super) fn either(_side: &str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    settings::read("toy-link", (), settings)?;
    Ok(codec(Decoder::new(), Lines))
}

struct Lines;

impl Messages for Lines {
    type Decoder = Decoder;

    fn show(&self, line: Message, json: &mut Vec<u8>) -> Kind {
        message(&line, json)
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>, EncodeError> {
        let message: Message = read(message)?;
        bytes(message.encoded_len(), |out| message.encode(out))
    }

    #[cfg(feature = "arbitrary")]
    fn arbitrary(&self, u: &mut arbitrary::Unstructured<'_>) -> arbitrary::Result<Value> {
        crate::codec::object(&u.arbitrary::<Message>()?)
    }
}
