use core::marker::PhantomData;

use anyhow::{Result, bail};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use val2_alter::{Decoder, Framing, HostMessage, Message, Received, RobotMessage};

use crate::codec::{Codec, EncodeError, Kind, Messages, bytes, codec, message, read};
use crate::settings;

/// What the `robot` or the `host` sends. The settings are the fields of [`Framing`].
///
/// # Errors
/// When a setting is unknown or has no such value.
pub(super) fn either(from: &str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    let framing = settings::read("val2-alter", Framing::DEFAULT, settings)?;
    match from {
        "robot" => Ok(side::<RobotMessage>(framing)),
        "host" => Ok(side::<HostMessage>(framing)),
        _ => bail!("val2-alter has no side `{from}`"),
    }
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

    fn show(&self, received: Received<M>, json: &mut Vec<u8>) -> Kind {
        message(&received.message, json)
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>, EncodeError> {
        let message: M = read(message)?;
        bytes(message.encoded_len(self.framing), |out| message.encode(self.framing, out))
    }
}
