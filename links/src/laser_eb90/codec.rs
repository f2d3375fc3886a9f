use anyhow::{Context, Result};
use laser_eb90::robot_session::Encode as _;
use laser_eb90::{Decoder, Frame, MAX_PAYLOAD, Payload, Profile};
use serde::de::DeserializeSeed;
use serde_json::{Map, Value};

use crate::codec::{Codec, EncodeError, Kind, Messages, bytes, codec, message};
use crate::settings;

/// Both directions have the same frames.
///
/// # Errors
/// When a setting is no field of `Profile`.
pub(super) fn either(settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    let profile = settings::read("laser-eb90", Profile::default(), settings)?;
    Ok(codec(Decoder::new(&profile), Eb90 { profile }))
}

struct Eb90 {
    profile: Profile,
}

impl Messages for Eb90 {
    type Decoder = Decoder;

    fn show(&self, frame: Frame<'_>, json: &mut Vec<u8>) -> Kind {
        message(&frame, json)
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>, EncodeError> {
        let mut buffer = [0; MAX_PAYLOAD];
        let mut payload = Payload::new(&mut buffer, &self.profile);
        payload.deserialize(message).context("is no laser-eb90 message")?;
        let frame = payload.frame().map_err(EncodeError::refused)?;
        bytes(frame.encoded_len(), |out| frame.encode(out))
    }
}
