use anyhow::{Context, Result};
use laser_eb90::robot_session::Encode as _;
use laser_eb90::{Decoder, Frame, MAX_PAYLOAD, Payload, Profile, Words};
use serde::de::DeserializeSeed;
use serde_json::{Map, Value};

use crate::codec::{Codec, EncodeError, Kind, Messages, bytes, codec, message};
use crate::settings::{self, Configure, FieldVisitor};

/// Creates the codec of either direction: both have the same frames.
///
/// # Errors
/// If a setting is not a field of `Profile`.
pub(super) fn either(settings: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    let Options { profile, .. } = settings::read("laser", Options::default(), settings)?;
    Ok(codec(Decoder::new(&profile), Eb90 { profile }))
}

/// The settings of a conversation: the form of its frames, and the meaning of its words for an observer.
#[derive(Default)]
pub(super) struct Options {
    profile: Profile,
    pub(super) words: Words,
}

impl Configure for Options {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { profile, words } = self;
        profile.configure(fields);
        let shape = "{commands: [{first, last, class}], errors: {bad_checksum, …}}";
        fields.parsed("words", shape, "for shadow ends: command words by class, and error codes", words);
    }
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
        payload.deserialize(message).context("is not a laser-eb90 message")?;
        let frame = payload.frame().map_err(EncodeError::refused)?;
        bytes(frame.encoded_len(), |out| frame.encode(out))
    }

    #[cfg(feature = "arbitrary")]
    fn arbitrary(&self, u: &mut arbitrary::Unstructured<'_>) -> arbitrary::Result<Value> {
        let mut buffer = [0; MAX_PAYLOAD];
        let payload = Payload::arbitrary(u, &mut buffer, &self.profile)?;
        let frame = payload.frame().map_err(|_| arbitrary::Error::IncorrectFormat)?;
        crate::codec::object(&frame)
    }
}
