use std::io;

use bytes::{Buf, Bytes, BytesMut};

use crate::decoder::Decoder;
use crate::error::{DecodeError, EncodeError};
use crate::message::Message;
use crate::value::Charset;

/// Messages over a `tokio_util` framed transport. Damage is an item of the stream and does not end it.
///
/// For traffic outside the sessions: logging, tests, messages of an application's own. A session takes its bytes as they come.
#[derive(Debug, Clone)]
pub struct Codec {
    decoder: Decoder,
    charset: Charset,
}

impl Codec {
    /// A codec at the beginning of a stream.
    pub const fn new(charset: Charset) -> Self {
        Self { decoder: Decoder::new(charset), charset }
    }

    fn next(&mut self) -> Option<Result<Frame, DecodeError>> {
        let charset = self.charset;
        self.decoder.next_frame().map(|frame| frame.map(|message| Frame::new(&message, charset)))
    }
}

/// The bytes of one message that was read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    bytes: Bytes,
    charset: Charset,
}

impl Frame {
    /// The bytes are written anew: blanks around the length are not kept.
    fn new(message: &Message<'_>, charset: Charset) -> Self {
        let mut bytes = BytesMut::with_capacity(message.encoded_len());
        // What was read can be written.
        let _ = message.append_to(charset, &mut bytes);
        Self { bytes: bytes.freeze(), charset }
    }

    /// The message.
    pub fn message(&self) -> Message<'_> {
        // They were written from a message.
        let decoded = Message::decode(&self.bytes, self.charset).ok().flatten();
        decoded.map_or(Message::new("", &[]), |(message, _)| message)
    }

    /// Its bytes.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes
    }
}

impl tokio_util::codec::Decoder for Codec {
    type Item = Result<Frame, DecodeError>;
    type Error = io::Error;

    fn decode(&mut self, src: &mut BytesMut) -> io::Result<Option<Self::Item>> {
        loop {
            if let Some(frame) = self.next() {
                return Ok(Some(frame));
            }
            if src.is_empty() {
                return Ok(None);
            }
            let taken = self.decoder.push(src);
            src.advance(taken);
        }
    }

    fn decode_eof(&mut self, src: &mut BytesMut) -> io::Result<Option<Self::Item>> {
        if let Some(item) = self.decode(src)? {
            return Ok(Some(item));
        }
        self.decoder.finish();
        self.decode(src)
    }
}

impl tokio_util::codec::Encoder<&Message<'_>> for Codec {
    type Error = io::Error;

    fn encode(&mut self, message: &Message<'_>, out: &mut BytesMut) -> io::Result<()> {
        let invalid = |error: EncodeError| io::Error::new(io::ErrorKind::InvalidInput, error);
        message.append_to(self.charset, out).map_err(invalid)
    }
}
