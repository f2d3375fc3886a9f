use core::marker::PhantomData;

use anyhow::{Result, bail};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use val2_alter::{DLE, Decoder, Framing, HostMessage, Message, ReceivedMessage, RobotMessage};

use crate::codec::{Codec, EncodeError, Kind, Messages, bytes, codec, message, read};
use crate::link::AcceptedMessage;
use crate::settings;

/// Returns the codec of the messages of the `robot` or the `host`. The settings are the fields of [`Framing`].
///
/// # Errors
/// If a setting is unknown or has no such value.
pub(super) fn either(from: &str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    let framing = settings::read("alter", Framing::DEFAULT, settings)?;
    match from {
        "robot" => Ok(side::<RobotMessage>(framing)),
        "host" => Ok(side::<HostMessage>(framing)),
        _ => bail!("val2-alter has no side `{from}`"),
    }
}

/// Returns whether a difference is tolerated: more DLEs before a message; or one less, if it was the checksum of the
/// previous one. The source does not state which bytes may follow the control byte of an end, and a start may lack its mark.
pub(super) fn tolerates(it: &AcceptedMessage<'_>) -> bool {
    let Some([_, written @ ..]) = it.written else { return false };
    let is_open = it.message["kind"] == "end" || it.message["marked"] == false;
    let ignores = it.settings.get("ignore_spare_select").is_some_and(|ignores| ignores == true);
    let before = it.bytes.strip_suffix(written);
    is_open || ignores || before.is_some_and(|before| before.iter().all(|byte| *byte == DLE))
}

struct Side<M> {
    framing: Framing,
    message: PhantomData<M>,
}

fn side<M: Message + Serialize + DeserializeOwned + 'static>(framing: Framing) -> Box<dyn Codec> {
    codec(Decoder::<M>::new(framing), Side { framing, message: PhantomData })
}

impl<M: Message + Serialize + DeserializeOwned> Messages for Side<M> {
    type Decoder = Decoder<M>;

    fn show(&self, received: ReceivedMessage<M>, json: &mut Vec<u8>) -> Kind {
        message(&received.message, json)
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>, EncodeError> {
        let message: M = read(message)?;
        bytes(message.encoded_len(self.framing), |out| message.encode(self.framing, out))
    }

    #[cfg(feature = "arbitrary")]
    fn arbitrary(&self, u: &mut arbitrary::Unstructured<'_>) -> arbitrary::Result<Value> {
        crate::codec::object(&u.arbitrary::<M>()?)
    }
}
