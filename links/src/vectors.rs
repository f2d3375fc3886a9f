//! The reference vectors of a link, and whether its codec agrees with them: `reference/vectors/<link>.json`, whose schema is
//! `reference/vectors.schema.json`.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};

use crate::codec::{self, Codec};
use crate::link::{AcceptedMessage, Link};

/// A vector.
#[derive(Debug, Clone, Deserialize)]
pub struct Vector {
    /// Unique in its file: the number of a withdrawn vector is never reused.
    pub id: u32,
    /// A description of the vector.
    pub comment: String,
    /// The side that sends these bytes; `None` for the link's first side.
    pub from: Option<String>,
    /// Settings of the codec other than the link's defaults, such as `{"framing":"rtu"}`.
    #[serde(default)]
    pub options: Map<String, Value>,
    /// The bytes on the wire. In the file: hex, spaced by field.
    #[serde(rename = "hex", deserialize_with = "hex")]
    pub bytes: Vec<u8>,
    /// The result of a decoder for the bytes.
    pub result: Outcome,
    /// The decoded object, for `valid` and `acceptable`; otherwise `None`.
    pub message: Option<Value>,
    /// For `invalid`, the first error's object: its `kind`, and further pinned fields; otherwise `None`.
    pub error: Option<Value>,
    /// Whether the result is given only at the end of the stream: the bytes are incomplete.
    #[serde(default)]
    pub end: bool,
    /// Whether the error is all that the bytes give.
    pub only: Option<bool>,
    /// The clauses of the specification that it shows.
    #[serde(default)]
    pub clauses: Vec<String>,
    /// Words to filter by, such as `stuffing` or `limit`.
    #[serde(default)]
    pub flags: Vec<String>,
}

/// The result of a decoder for a vector's bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// An object, which encodes to exactly these bytes.
    Valid,
    /// An object, which the encoder writes another way or not at all.
    Acceptable,
    /// An error: the bytes are not a message.
    Invalid,
}

/// Reads the vectors of a file.
///
/// # Errors
/// If it cannot be read, or is not a file of vectors.
pub fn vectors(file: impl AsRef<Path>) -> Result<Vec<Vector>> {
    vectors_in(&fs::read_to_string(&file).with_context(|| file.as_ref().display().to_string())?)
}

/// Reads the vectors of a file's text.
///
/// # Errors
/// If the text is not a file of vectors.
pub fn vectors_in(text: &str) -> Result<Vec<Vector>> {
    #[derive(Deserialize)]
    struct File {
        vectors: Vec<Vector>,
    }
    Ok(serde_json::from_str::<File>(text)?.vectors)
}

impl Vector {
    /// Returns the codec of the side that sends the vector's bytes.
    ///
    /// # Errors
    /// If the link has no such side or setting.
    pub fn codec(&self, link: &Link) -> Result<Box<dyn Codec>> {
        (link.codec)(link.side(self.from.as_deref())?, &self.options)
    }

    /// Checks that the codec decodes the bytes, read in these pieces, as the vector states, and encodes the message to these
    /// bytes.
    ///
    /// # Errors
    /// The first difference.
    pub fn check(&self, link: &Link, pieces: &[&[u8]]) -> Result<()> {
        let items = codec::items(self.codec(link)?, &[pieces.to_vec()])?;
        let Some(first) = items.first() else { bail!("gives nothing") };
        ensure!(first.at_end == self.end, "is given at the end of the stream: {}", first.at_end);
        match (&self.message, &self.error) {
            (Some(message), None) if self.result != Outcome::Invalid => {
                let is_all = items.len() == 1 && first.value()? == Ok(message.clone());
                ensure!(is_all, "decodes to {items:?}, not to {message}");
                let encoded = self.codec(link)?.encode(message.clone());
                let is_same = encoded.as_ref().is_ok_and(|bytes| *bytes == self.bytes);
                ensure!(is_same == (self.result == Outcome::Valid), "encodes to {encoded:02X?}");
                let written = encoded.as_deref().ok();
                let accepted =
                    AcceptedMessage { settings: &self.options, message, bytes: &self.bytes, written };
                ensure!(link.accepts(&accepted), "the link's only encoding is {encoded:02X?}");
            }
            (None, Some(error)) if self.result == Outcome::Invalid => {
                let fits = first.value()?.is_err_and(|found| includes(&found, error));
                ensure!(fits, "gives {items:?}, not the error {error}");
                ensure!(self.only == Some(items.len() == 1), "gives {items:?}");
            }
            _ => bail!("the vector has not what its result asks for: a message, or an error"),
        }
        Ok(())
    }
}

/// Returns whether `found` contains everything that `expected` contains: a vector pins down an error's kind and, if
/// relevant, its fields.
pub fn includes(found: &Value, expected: &Value) -> bool {
    match (found, expected) {
        (Value::Object(found), Value::Object(expected)) => {
            expected.iter().all(|(key, value)| found.get(key).is_some_and(|found| includes(found, value)))
        }
        _ => found == expected,
    }
}

/// Parses hex digits; spaces are ignored.
///
/// # Errors
/// If a character is not a hex digit, or their number is odd.
pub fn unhex(text: &str) -> Result<Vec<u8>> {
    let digits: Vec<u8> = text.bytes().filter(|byte| !byte.is_ascii_whitespace()).collect();
    ensure!(digits.len().is_multiple_of(2), "an odd number of hex digits: {text}");
    let pairs = digits.chunks(2).map(|pair| Ok(u8::from_str_radix(core::str::from_utf8(pair)?, 16)?));
    pairs.collect::<Result<_>>().with_context(|| format!("not hex: {text}"))
}

fn hex<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u8>, D::Error> {
    unhex(&String::deserialize(deserializer)?).map_err(serde::de::Error::custom)
}
