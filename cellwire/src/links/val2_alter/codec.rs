use anyhow::{Result, bail};
use robot_session::Decoder as _;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use val2_alter::{Decoder, Frame, Framing, HostMessage, Message, RobotMessage};

use crate::links::codec::Codec;

/// What the `robot` or the `host` sends. The settings are the fields of [`Framing`].
///
/// # Errors
/// When a setting is unknown or has no such value.
pub(super) fn codec(side: &str, settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    let framing = serde_json::from_value(Value::Object(settings.clone()))?;
    match side {
        "robot" => Ok(Box::new(Side::<RobotMessage>::new(framing))),
        "host" => Ok(Box::new(Side::<HostMessage>::new(framing))),
        _ => bail!("val2-alter has no side `{side}`"),
    }
}

struct Side<M> {
    decoder: Decoder<M>,
    framing: Framing,
}

impl<M: Message> Side<M> {
    fn new(framing: Framing) -> Self {
        Self { decoder: Decoder::new(framing), framing }
    }
}

impl<M: Message + Serialize + DeserializeOwned> Codec for Side<M> {
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.decoder.push(bytes)
    }

    fn next(&mut self) -> Option<Result<Value, Value>> {
        let item = self.decoder.next_frame()?;
        Some(match item {
            Ok(received) => Ok(serde_json::to_value(received.message).unwrap_or_default()),
            Err(error) => Err(serde_json::to_value(error).unwrap_or_default()),
        })
    }

    fn finish(&mut self) {
        self.decoder.finish();
    }

    fn position(&self) -> u64 {
        self.decoder.position()
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>> {
        let message: M = serde_json::from_value(message)?;
        let mut frame = [0; Frame::MAX_LEN];
        let length = message.encode(self.framing, &mut frame)?;
        Ok(frame.get(..length).unwrap_or_default().to_vec())
    }
}
