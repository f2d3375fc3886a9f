//! A decoder under `tokio_util`'s framed transports.

use std::io;

use bytes::{Buf as _, BufMut as _, BytesMut};

use crate::{Decoder, Encode};

/// A decoder as a `tokio_util` codec. Corrupt bytes are an item of the stream and do not end it.
///
/// A frame borrows the decoder: `own` converts it to the item of the stream.
#[derive(Debug, Clone)]
pub struct Codec<D, F> {
    decoder: D,
    own: F,
}

impl<D: Decoder, I, F: FnMut(D::Frame<'_>) -> I> Codec<D, F> {
    /// Creates a codec over `decoder`.
    pub fn new(decoder: D, own: F) -> Self {
        Self { decoder, own }
    }

    /// Returns the decoder, for example for the position of the last frame or error.
    pub fn decoder(&self) -> &D {
        &self.decoder
    }
}

impl<D: Decoder, I, F: FnMut(D::Frame<'_>) -> I> tokio_util::codec::Decoder for Codec<D, F> {
    type Item = Result<I, D::Error>;
    type Error = io::Error;

    fn decode(&mut self, src: &mut BytesMut) -> io::Result<Option<Self::Item>> {
        loop {
            if let Some(frame) = self.decoder.next_frame() {
                return Ok(Some(frame.map(&mut self.own)));
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

impl<D, F, M: Encode> tokio_util::codec::Encoder<M> for Codec<D, F>
where
    M::Error: core::error::Error + Send + Sync + 'static,
{
    type Error = io::Error;

    fn encode(&mut self, message: M, out: &mut BytesMut) -> io::Result<()> {
        let before = out.len();
        out.put_bytes(0, message.encoded_len());
        match message.encode(out.get_mut(before..).unwrap_or_default()) {
            Ok(_) => Ok(()),
            Err(error) => {
                out.truncate(before);
                Err(io::Error::new(io::ErrorKind::InvalidInput, error))
            }
        }
    }
}
