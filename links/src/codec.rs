//! The interface between the tool and a link's decoder and encoder: bytes to lines of JSON and back.

use std::io::{self, Write};

use anyhow::Result;
use robot_session::Decoder;
use serde::Serialize;
use serde_json::{Value, json};

use crate::json;

/// One direction of one link.
pub trait Codec {
    /// Takes bytes; returns how many, 0 when the decoder's buffer is full.
    fn push(&mut self, bytes: &[u8]) -> usize;

    /// Writes the next message object, or error object; `None` when more bytes are needed.
    fn next(&mut self, json: &mut Vec<u8>) -> Option<Kind>;

    /// The stream has ended: an incomplete frame becomes an error of `next`, or its bytes remain after the last position.
    fn finish(&mut self);

    /// The stream offset of the first byte after what `next` returned last.
    fn position(&self) -> u64;

    /// The bytes of one message object.
    ///
    /// # Errors
    /// When the object is not a message of this link, or a value cannot be encoded.
    fn encode(&self, message: Value) -> Result<Vec<u8>>;
}

/// What an object is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A message.
    Message,
    /// Why bytes are none.
    Error,
}

/// What a codec needs beside the link's decoder.
pub trait Messages {
    /// The link's decoder.
    type Decoder: Decoder;

    /// Writes a frame of the decoder, with [`message`] or [`error`].
    fn show(&self, frame: <Self::Decoder as Decoder>::Frame<'_>, json: &mut Vec<u8>) -> Kind;

    /// The bytes of one message object.
    ///
    /// # Errors
    /// When the object is not a message of this link, or a value cannot be encoded.
    fn encode(&self, message: Value) -> Result<Vec<u8>>;
}

/// Writes a message object.
pub fn message(message: &impl Serialize, json: &mut Vec<u8>) -> Kind {
    write(message, json);
    Kind::Message
}

/// Writes an error object.
pub fn error(error: &impl Serialize, json: &mut Vec<u8>) -> Kind {
    write(error, json);
    Kind::Error
}

/// The decoder and the messages of a link as a codec.
pub fn codec<M>(decoder: M::Decoder, messages: M) -> Box<dyn Codec>
where
    M: Messages + 'static,
    <M::Decoder as Decoder>::Error: Serialize,
{
    Box::new(Pair { decoder, messages })
}

struct Pair<M: Messages> {
    decoder: M::Decoder,
    messages: M,
}

impl<M: Messages> Codec for Pair<M>
where
    <M::Decoder as Decoder>::Error: Serialize,
{
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.decoder.push(bytes)
    }

    fn next(&mut self, json: &mut Vec<u8>) -> Option<Kind> {
        Some(match self.decoder.next_frame()? {
            Ok(frame) => self.messages.show(frame, json),
            Err(found) => error(&found, json),
        })
    }

    fn finish(&mut self) {
        self.decoder.finish();
    }

    fn position(&self) -> u64 {
        self.decoder.position()
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>> {
        self.messages.encode(message)
    }
}

/// A part of the stream.
#[derive(Debug, Clone, Copy)]
pub struct Item<'a> {
    /// The first byte, from the start of the stream.
    pub offset: u64,
    /// The number of bytes.
    pub length: u64,
    /// What `json` is.
    pub kind: Kind,
    /// The object.
    pub json: &'a [u8],
}

impl Item<'_> {
    /// Writes the line `{"offset":…,"length":…,"message":{…}}`, or with `"error"` in place of `"message"`. `label` are the fields
    /// before it: nothing, or such as `"flow":"…",`.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_line(&self, label: &str, mut out: impl Write) -> io::Result<()> {
        out.write_all(b"{")?;
        out.write_all(label.as_bytes())?;
        out.write_all(b"\"offset\":")?;
        serde_json::to_writer(&mut out, &self.offset)?;
        out.write_all(b",\"length\":")?;
        serde_json::to_writer(&mut out, &self.length)?;
        out.write_all(if self.kind == Kind::Message { b",\"message\":" } else { b",\"error\":" })?;
        out.write_all(self.json)?;
        out.write_all(b"}\n")
    }

    /// The object as a value: of a message, or of an error.
    ///
    /// # Errors
    /// None: it is an object.
    pub fn content(&self) -> serde_json::Result<Result<Value, Value>> {
        let value = serde_json::from_slice(self.json)?;
        Ok(if self.kind == Kind::Message { Ok(value) } else { Err(value) })
    }
}

/// Feeds a codec and divides the stream into items: every byte is in exactly one.
#[allow(missing_debug_implementations, reason = "not every codec implements it")]
pub struct Stream {
    codec: Box<dyn Codec>,
    /// The offset at which it begins.
    begin: u64,
    taken: u64,
    json: Vec<u8>,
}

impl Stream {
    /// A stream at offset 0.
    pub fn new(codec: Box<dyn Codec>) -> Self {
        Self::starting_at(codec, 0)
    }

    /// A stream that goes on at another's offset, with a decoder that knows nothing of what was before.
    pub fn starting_at(codec: Box<dyn Codec>, begin: u64) -> Self {
        Self { codec, begin, taken: 0, json: Vec::new() }
    }

    /// The offset of the next byte.
    pub fn offset(&self) -> u64 {
        self.begin + self.taken
    }

    /// Takes all of `bytes`, and calls `emit` for each complete item.
    ///
    /// # Errors
    /// Whatever `emit` returns.
    pub fn push(&mut self, mut bytes: &[u8], mut emit: impl FnMut(Item<'_>) -> Result<()>) -> Result<()> {
        while !bytes.is_empty() {
            let taken = self.codec.push(bytes);
            self.taken += taken as u64;
            bytes = bytes.get(taken..).unwrap_or_default();
            let before = self.codec.position();
            self.drain(&mut emit)?;
            anyhow::ensure!(
                taken > 0 || self.codec.position() > before,
                "the decoder makes no progress at byte {before}: please report these bytes as a bug"
            );
        }
        Ok(())
    }

    /// Ends the stream: remaining bytes that are not a whole frame are an error of kind `incomplete`.
    ///
    /// # Errors
    /// Whatever `emit` returns.
    pub fn finish(mut self, mut emit: impl FnMut(Item<'_>) -> Result<()>) -> Result<()> {
        self.codec.finish();
        self.drain(&mut emit)?;
        let offset = self.codec.position();
        let length = self.taken - offset;
        if length == 0 {
            return Ok(());
        }
        let kind = error(&json!({"kind": "incomplete"}), &mut self.json);
        emit(Item { offset: self.begin + offset, length, kind, json: &self.json })
    }

    fn drain(&mut self, emit: &mut impl FnMut(Item<'_>) -> Result<()>) -> Result<()> {
        loop {
            let offset = self.codec.position();
            self.json.clear();
            let Some(kind) = self.codec.next(&mut self.json) else { return Ok(()) };
            let length = self.codec.position() - offset;
            emit(Item { offset: self.begin + offset, length, kind, json: &self.json })?;
        }
    }
}

/// Every value of the links is one of numbers, texts and names, which JSON has.
fn write(value: &impl Serialize, json: &mut Vec<u8>) {
    if json::write(value, json).is_err() {
        json.clear();
        json.extend_from_slice(b"null");
    }
}
