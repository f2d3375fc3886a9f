use anyhow::{Context, Result};
use laser_eb90::robot_session::{Decoder as _, Encode as _};
use laser_eb90::{Decoder, MAX_PAYLOAD, Payload, Profile};
use serde::de::DeserializeSeed;
use serde_json::{Map, Value};

use crate::links::codec::Codec;

/// Both directions have the same frames.
///
/// # Errors
/// When a setting is no field of `Profile`.
pub(super) fn codec(settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    let profile = super::profile::profile(settings)?;
    Ok(Box::new(Eb90 { decoder: Decoder::new(&profile), profile }))
}

struct Eb90 {
    decoder: Decoder,
    profile: Profile,
}

impl Codec for Eb90 {
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.decoder.push(bytes)
    }

    fn next(&mut self) -> Option<Result<Value, Value>> {
        Some(match self.decoder.next_frame()? {
            // Through text, where a float is as short as its type allows: 100.1, not 100.0999984741211.
            Ok(frame) => {
                let text = serde_json::to_string(&frame).unwrap_or_default();
                Ok(serde_json::from_str(&text).unwrap_or_default())
            }
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
        let mut buffer = [0; MAX_PAYLOAD];
        let mut payload = Payload::new(&mut buffer, &self.profile);
        payload.deserialize(message).context("is no laser-eb90 message")?;
        let frame = payload.frame()?;
        let mut out = vec![0; frame.encoded_len()];
        frame.encode(&mut out)?;
        Ok(out)
    }
}
