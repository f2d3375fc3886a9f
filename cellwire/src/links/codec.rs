//! The interface between the tool and a link's decoder and encoder: bytes to JSON lines and back.

use anyhow::Result;
use serde_json::{Value, json};

/// One direction of one link.
///
/// The first four are the methods of a link's `Decoder`, with frames and errors in their `serde` form.
pub trait Codec {
    /// Takes bytes; returns how many, 0 when the decoder's buffer is full.
    fn push(&mut self, bytes: &[u8]) -> usize;

    /// The next message object, or error object; `None` when more bytes are needed.
    fn next(&mut self) -> Option<Result<Value, Value>>;

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

/// A part of the stream: `Ok` with a message object, or `Err` with an error object.
#[derive(Debug, Clone, PartialEq)]
pub struct Item {
    /// The first byte, from the start of the stream.
    pub offset: u64,
    /// The number of bytes.
    pub length: u64,
    /// The message or the error.
    pub content: Result<Value, Value>,
}

impl Item {
    /// The item as one object: `{"offset":…,"length":…,"message":{…}}`, or with `"error"` in place of `"message"`.
    pub fn to_json(&self) -> Value {
        match &self.content {
            Ok(message) => json!({"offset": self.offset, "length": self.length, "message": message}),
            Err(error) => json!({"offset": self.offset, "length": self.length, "error": error}),
        }
    }
}

/// Feeds a codec and divides the stream into items: every byte is in exactly one.
#[allow(missing_debug_implementations, reason = "not every codec implements it")]
pub struct Stream {
    codec: Box<dyn Codec>,
    taken: u64,
}

impl Stream {
    /// A stream at offset 0.
    pub fn new(codec: Box<dyn Codec>) -> Self {
        Self { codec, taken: 0 }
    }

    /// The number of bytes taken so far.
    pub fn offset(&self) -> u64 {
        self.taken
    }

    /// Takes all of `bytes`, and calls `emit` for each complete item.
    ///
    /// # Errors
    /// Whatever `emit` returns.
    pub fn push(&mut self, mut bytes: &[u8], mut emit: impl FnMut(Item) -> Result<()>) -> Result<()> {
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
    pub fn finish(mut self, mut emit: impl FnMut(Item) -> Result<()>) -> Result<()> {
        self.codec.finish();
        self.drain(&mut emit)?;
        let offset = self.codec.position();
        let length = self.taken - offset;
        if length == 0 {
            return Ok(());
        }
        emit(Item { offset, length, content: Err(json!({"kind": "incomplete"})) })
    }

    fn drain(&mut self, emit: &mut impl FnMut(Item) -> Result<()>) -> Result<()> {
        loop {
            let offset = self.codec.position();
            let Some(content) = self.codec.next() else { return Ok(()) };
            emit(Item { offset, length: self.codec.position() - offset, content })?;
        }
    }
}
