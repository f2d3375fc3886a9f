use anyhow::Result;
use robot_session::{Decoder as _, Encode as _};
use serde_json::{Map, Value};
use val2_viewer::{Decoder, PosePacket};

use crate::links::codec::Codec;
use crate::links::settings::Settings;

/// What the host sends. The workstation's ENQ is one byte and no message.
///
/// # Errors
/// When a setting is given: the link has none.
pub(super) fn codec(settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    Settings::new("val2-viewer", settings, &[])?;
    Ok(Box::new(Host(Decoder::new())))
}

struct Host(Decoder);

impl Codec for Host {
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.0.push(bytes)
    }

    fn next(&mut self) -> Option<Result<Value, Value>> {
        let item = self.0.next_frame()?;
        Some(match item {
            Ok(packet) => Ok(serde_json::to_value(packet).unwrap_or_default()),
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
        let packet: PosePacket = serde_json::from_value(message)?;
        let mut bytes = vec![0; packet.encoded_len()];
        packet.encode(&mut bytes)?;
        Ok(bytes)
    }
}
