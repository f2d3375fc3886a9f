//! `tokio_util` framed transports.

use std::io;

use bytes::{Buf, BytesMut};

use crate::{DecodeError, Decoder, Framing, Message, Received};

/// Messages of one side (`M`) over a framed transport; writes messages of either. Damage is an item of the stream and does
/// not end it.
///
/// The deadlines of ALTER are short: measure what a runtime takes of them before a robot depends on it.
#[derive(Debug, Clone)]
pub struct Codec<M> {
    framing: Framing,
    decoder: Decoder<M>,
}

impl<M: Message> Codec<M> {
    /// A codec at the beginning of a stream.
    pub fn new(framing: Framing) -> Self {
        Self { framing, decoder: Decoder::new(framing) }
    }
}

impl<M: Message> tokio_util::codec::Decoder for Codec<M> {
    type Item = Result<Received<M>, DecodeError>;
    type Error = io::Error;

    fn decode(&mut self, src: &mut BytesMut) -> io::Result<Option<Self::Item>> {
        loop {
            if let Some(item) = self.decoder.next_frame() {
                return Ok(Some(item));
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

impl<M: Message, Out: Message> tokio_util::codec::Encoder<Out> for Codec<M> {
    type Error = io::Error;

    fn encode(&mut self, message: Out, out: &mut BytesMut) -> io::Result<()> {
        message.append_to(self.framing, out);
        Ok(())
    }
}
