use std::io;

use bytes::{Buf, BytesMut};

use crate::{DecodeError, Decoder, EncodeError, Packet};

/// Packets over a `tokio_util` framed transport. Damage is an item of the stream and does not end it.
#[derive(Debug, Clone, Default)]
pub struct Codec {
    decoder: Decoder,
}

impl Codec {
    /// A codec at the beginning of a stream.
    pub const fn new() -> Self {
        Self { decoder: Decoder::new() }
    }
}

impl tokio_util::codec::Decoder for Codec {
    type Item = Result<Packet, DecodeError>;
    type Error = io::Error;

    fn decode(&mut self, src: &mut BytesMut) -> io::Result<Option<Self::Item>> {
        loop {
            if let Some(frame) = self.decoder.next_frame() {
                return Ok(Some(frame.and_then(|frame| frame.packet())));
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

impl tokio_util::codec::Encoder<Packet> for Codec {
    type Error = io::Error;

    fn encode(&mut self, packet: Packet, out: &mut BytesMut) -> io::Result<()> {
        let invalid = |error: EncodeError| io::Error::new(io::ErrorKind::InvalidInput, error);
        packet.append_to(out).map(drop).map_err(invalid)
    }
}
