//! The interface between the tool and a link's decoder and encoder: bytes to lines of JSON and back.

use std::io::{self, Write};

use anyhow::Result;
#[cfg(feature = "arbitrary")]
use arbitrary::Unstructured;
use robot_session::Decoder;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::json;

/// One direction of one link.
pub trait Codec {
    /// Takes bytes; returns how many, 0 when the decoder's buffer is full.
    fn push(&mut self, bytes: &[u8]) -> usize;

    /// Writes the next message object, or error object; `None` when more bytes are needed.
    fn next(&mut self, json: &mut Vec<u8>) -> Option<Kind>;

    /// Called when the stream has ended: an incomplete frame becomes an error of `next`.
    fn finish(&mut self);

    /// Returns the stream offset after the frame or error that `next` returned last.
    fn position(&self) -> u64;

    /// Discards the bytes in the buffer; they count in [`position`](Self::position).
    fn clear(&mut self);

    /// Encodes one message object.
    ///
    /// # Errors
    /// If the object is not a message of this link, or a value cannot be encoded.
    fn encode(&self, message: Value) -> Result<Vec<u8>, EncodeError>;

    /// Implements [`Messages::names`].
    fn names(&self, message: &Value) -> Vec<(String, &'static str)>;

    /// Implements [`Messages::is_filler`].
    fn is_filler(&self, message: &Value) -> bool;

    /// Generates a message object from a fuzzer's bytes, in the decoder's form, which [`encode`](Self::encode) accepts.
    ///
    /// # Errors
    /// If there are too few bytes for the message that they begin.
    #[cfg(feature = "arbitrary")]
    fn arbitrary(&self, u: &mut Unstructured<'_>) -> arbitrary::Result<Value>;
}

/// The reason why an object has no bytes.
#[derive(Debug, thiserror::Error)]
pub enum EncodeError {
    /// The object is not a message of this link.
    #[error(transparent)]
    Message(#[from] anyhow::Error),
    /// The link's encoder refuses the message.
    #[error("{text}")]
    Refused {
        /// The encoder's error as text.
        text: String,
        /// The encoder's error as an object.
        json: String,
    },
}

impl EncodeError {
    /// Returns the error object: `{"kind":"message"}`, or the encoder's.
    pub fn json(&self) -> &str {
        match self {
            Self::Message(_) => r#"{"kind":"message"}"#,
            Self::Refused { json, .. } => json,
        }
    }

    /// Creates the error of a link's encoder.
    pub fn refused(error: impl core::error::Error + Serialize) -> Self {
        Self::Refused { text: error.to_string(), json: json::text(&error) }
    }
}

/// The two kinds of objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The object of a message.
    Message,
    /// The reason for which bytes are not a message.
    Error,
}

/// A link's messages: their conversion to and from JSON, beside the link's decoder.
pub trait Messages {
    /// The link's decoder.
    type Decoder: Decoder;

    /// Writes a frame of the decoder, with [`message`] or [`error`].
    fn show(&self, frame: <Self::Decoder as Decoder>::Frame<'_>, json: &mut Vec<u8>) -> Kind;

    /// Encodes one message object.
    ///
    /// # Errors
    /// If the object is not a message of this link, or a value cannot be encoded.
    fn encode(&self, message: Value) -> Result<Vec<u8>, EncodeError>;

    /// Returns the names of the values that the object has under other keys, each with its JSON pointer. Values of one name
    /// repeat one another, such as the order number of a header and that of a field.
    fn names(&self, _message: &Value) -> Vec<(String, &'static str)> {
        Vec::new()
    }

    /// Returns whether a message has no content, and is sent only because a packet must be sent: the number of such messages
    /// depends on the times alone.
    fn is_filler(&self, _message: &Value) -> bool {
        false
    }

    /// Generates a message object from a fuzzer's bytes, with [`object`].
    ///
    /// # Errors
    /// If there are too few bytes for the message that they begin.
    #[cfg(feature = "arbitrary")]
    fn arbitrary(&self, u: &mut Unstructured<'_>) -> arbitrary::Result<Value>;
}

/// Reads a message from its object.
///
/// # Errors
/// If the object is not such a message.
pub fn read<M: DeserializeOwned>(message: Value) -> Result<M, EncodeError> {
    Ok(M::deserialize(&message).map_err(anyhow::Error::new)?)
}

/// Returns the bytes that an encoder writes; `length` is the number that it states.
///
/// # Errors
/// The encoder's error.
pub fn bytes<E: core::error::Error + Serialize>(
    length: usize,
    encode: impl Fn(&mut [u8]) -> Result<usize, E>,
) -> Result<Vec<u8>, EncodeError> {
    debug_assert!(
        encode(&mut vec![0; length.saturating_sub(1)]).is_err(),
        "less than {length} bytes are enough"
    );
    let mut bytes = vec![0; length];
    let written = encode(&mut bytes).map_err(EncodeError::refused)?;
    debug_assert_eq!(written, length, "the encoded length is wrong");
    Ok(bytes)
}

/// Returns the object of a message, with numbers as the encoder expects them.
///
/// # Errors
/// None: every message has an object.
#[cfg(feature = "arbitrary")]
pub fn object(message: &impl Serialize) -> arbitrary::Result<Value> {
    serde_json::from_str(&json::text(message)).map_err(|_| arbitrary::Error::IncorrectFormat)
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

/// Joins the decoder and the messages of a link to a codec.
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

    fn clear(&mut self) {
        self.decoder.clear();
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>, EncodeError> {
        self.messages.encode(message)
    }

    fn names(&self, message: &Value) -> Vec<(String, &'static str)> {
        self.messages.names(message)
    }

    fn is_filler(&self, message: &Value) -> bool {
        self.messages.is_filler(message)
    }

    #[cfg(feature = "arbitrary")]
    fn arbitrary(&self, u: &mut Unstructured<'_>) -> arbitrary::Result<Value> {
        self.messages.arbitrary(u)
    }
}

/// A part of the stream.
#[derive(Debug, Clone, Copy)]
pub struct Item<'a> {
    /// The offset of the first byte, from the start of the stream.
    pub offset: u64,
    /// The number of bytes of the item.
    pub length: u64,
    /// The kind of `json`.
    pub kind: Kind,
    /// The object of a message or of an error, as JSON.
    pub json: &'a [u8],
}

impl Item<'_> {
    /// Writes the line `{"offset":…,"length":…,"message":{…}}`, or with `"error"` in place of `"message"`. `label` are the fields
    /// before it: nothing, or such as `"flow":"…",`.
    ///
    /// # Errors
    /// An error of `out`.
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
}

/// A stored item.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StreamItem {
    /// The offset of the first byte, from the start of the stream.
    pub offset: u64,
    /// The number of bytes of the item.
    pub length: u64,
    /// The object of a message, or of an error, as JSON.
    pub content: Result<String, String>,
    /// Whether the item is given only because the stream ends.
    pub at_end: bool,
}

impl StreamItem {
    /// Returns the object as a JSON value: of a message, or of an error.
    ///
    /// # Errors
    /// None: it is an object.
    pub fn value(&self) -> serde_json::Result<Result<Value, Value>> {
        Ok(match &self.content {
            Ok(message) => Ok(serde_json::from_str(message)?),
            Err(error) => Err(serde_json::from_str(error)?),
        })
    }
}

/// Returns all items of a stream that arrives in these pieces, and ends after each part.
///
/// # Errors
/// If the decoder makes no progress, or the items do not cover every byte.
pub fn items(codec: Box<dyn Codec>, parts: &[Vec<&[u8]>]) -> Result<Vec<StreamItem>> {
    let (mut stream, mut items) = (Stream::new(codec), Vec::new());
    for part in parts {
        let mut keep = |item: Item<'_>, at_end| {
            let json = String::from_utf8(item.json.to_vec())?;
            let content = if item.kind == Kind::Message { Ok(json) } else { Err(json) };
            items.push(StreamItem { offset: item.offset, length: item.length, content, at_end });
            Ok(())
        };
        for piece in part {
            stream.push(piece, |item| keep(item, false))?;
        }
        stream.finish(|item| keep(item, true))?;
    }
    Ok(items)
}

/// Feeds a codec and divides the stream into items: every byte is in exactly one.
#[allow(missing_debug_implementations, reason = "not every codec implements it")]
pub struct Stream {
    codec: Box<dyn Codec>,
    /// The offset at which it begins, and how many bytes were taken out since.
    begin: u64,
    taken: u64,
    json: Vec<u8>,
    /// The two flow-control bytes, which are removed; `None` if the link has no such bytes.
    flow_control: Option<[u8; 2]>,
}

impl Stream {
    /// Creates a stream at offset 0.
    pub fn new(codec: Box<dyn Codec>) -> Self {
        Self::starting_at(codec, 0)
    }

    /// Creates a stream that continues at another's offset, with a new decoder.
    pub fn starting_at(codec: Box<dyn Codec>, begin: u64) -> Self {
        Self { codec, begin, taken: 0, json: Vec::new(), flow_control: None }
    }

    /// Takes these bytes out wherever they are: they are in no item. One within an item counts in its offset as before it.
    #[must_use]
    pub fn without(self, flow_control: Option<[u8; 2]>) -> Self {
        Self { flow_control, ..self }
    }

    /// Returns the offset of the next byte.
    pub fn offset(&self) -> u64 {
        self.begin + self.taken
    }

    /// Takes all of `bytes`, and calls `emit` for each complete item.
    ///
    /// # Errors
    /// The error that `emit` returns.
    pub fn push(&mut self, bytes: &[u8], mut emit: impl FnMut(Item<'_>) -> Result<()>) -> Result<()> {
        let mut rest = bytes;
        while let Some([hold, go_on]) = self.flow_control
            && let Some(at) = memchr::memchr2(hold, go_on, rest)
        {
            let (piece, after) = rest.split_at(at);
            self.push_piece(piece, &mut emit)?;
            self.begin += 1;
            rest = after.get(1..).unwrap_or_default();
        }
        self.push_piece(rest, &mut emit)
    }

    fn push_piece(&mut self, mut bytes: &[u8], emit: &mut impl FnMut(Item<'_>) -> Result<()>) -> Result<()> {
        while !bytes.is_empty() {
            let taken = self.codec.push(bytes);
            self.taken += taken as u64;
            bytes = bytes.get(taken..).unwrap_or_default();
            let before = self.codec.position();
            self.drain(emit)?;
            anyhow::ensure!(
                taken > 0 || self.codec.position() > before,
                "the decoder makes no progress at byte {before}: please report these bytes as a bug"
            );
        }
        Ok(())
    }

    /// Ends the stream, or reports that the line is silent: remaining bytes that are not a whole frame are an error.
    ///
    /// # Errors
    /// The error that `emit` returns.
    pub fn finish(&mut self, mut emit: impl FnMut(Item<'_>) -> Result<()>) -> Result<()> {
        self.codec.finish();
        self.drain(&mut emit)?;
        let (taken, end) = (self.taken, self.codec.position());
        anyhow::ensure!(end == taken, "the items cover {end} of {taken} bytes: please report them as a bug");
        Ok(())
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

/// Writes a value as JSON: every value of the links consists of numbers, texts and names, which JSON has.
fn write(value: &impl Serialize, json: &mut Vec<u8>) {
    if json::write(value, json).is_err() {
        json.clear();
        json.extend_from_slice(b"null");
    }
}
