use anyhow::Result;
use isra_ball::robot_session::Decoder as _;
use isra_ball::{Decoder, Packet};
use serde_json::{Map, Value};

use crate::links::codec::Codec;
use crate::links::settings::Settings;

/// What the ball sends. The host's ENQ is one byte and no message.
///
/// # Errors
/// When a setting is given: the link has none.
pub(super) fn codec(settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    Settings::new("isra-ball", settings, &[])?;
    Ok(Box::new(Ball(Decoder::new())))
}

struct Ball(Decoder);

impl Codec for Ball {
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.0.push(bytes)
    }

    fn next(&mut self) -> Option<Result<Value, Value>> {
        let item = self.0.next_frame()?;
        Some(match item {
            Ok(frame) => Ok(serde_json::to_value(frame).unwrap_or_default()),
            Err(error) => Err(serde_json::to_value(error).unwrap_or_default()),
        })
    }

    fn finish(&mut self) {
        self.0.finish();
    }

    fn position(&self) -> u64 {
        self.0.position()
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>> {
        let packet: Packet = serde_json::from_value(message)?;
        Ok(packet.to_bytes()?.to_vec())
    }
}
