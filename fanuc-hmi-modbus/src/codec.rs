use std::io;

use bytes::{Buf, BytesMut};

use crate::decoder::{Decoder, Framing};
use crate::error::{DecodeError, EncodeError};
use crate::frame::{Frame, Side};
use crate::message::{Pdu, PduBuf};

/// Frames over a `tokio_util` framed transport. Damage is an item of the stream and does not end it.
///
/// An RTU frame whose function has no type of its own is seen at the end of the stream alone: only a silence tells where it
/// ends, and a codec hears none.
#[derive(Debug, Clone)]
pub struct Codec {
    decoder: Decoder,
    tcp: bool,
}

impl Codec {
    /// A codec for the end that hears `side`, at the beginning of a stream.
    pub const fn new(framing: Framing, side: Side) -> Self {
        Self { decoder: Decoder::new(framing, side), tcp: framing.has_transactions() }
    }
}

impl tokio_util::codec::Decoder for Codec {
    type Item = Result<Frame<PduBuf>, DecodeError>;
    type Error = io::Error;

    fn decode(&mut self, src: &mut BytesMut) -> io::Result<Option<Self::Item>> {
        loop {
            if let Some(frame) = self.decoder.next_frame() {
                let frame = frame.map(|frame| frame.to_owned().map_err(invalid));
                return frame.map_or_else(|error| Ok(Some(Err(error))), |frame| Ok(Some(Ok(frame?))));
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

impl<P: Pdu> tokio_util::codec::Encoder<Frame<P>> for Codec {
    type Error = io::Error;

    /// Writes the frame as the transport wants it: without its transaction on RTU, with transaction 0 on TCP if it has none.
    fn encode(&mut self, frame: Frame<P>, out: &mut BytesMut) -> io::Result<()> {
        let transaction = self.tcp.then(|| frame.transaction.unwrap_or_default());
        Frame { transaction, ..frame }.append_to(out).map(drop).map_err(invalid)
    }
}

fn invalid(error: EncodeError) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, error)
}
