//! Frames over a `tokio_util` framed transport.

use std::io;

use bytes::{Buf, Bytes, BytesMut};

use crate::decoder::Decoder;
use crate::error::DecodeError;
use crate::frame::Frame;
use crate::profile::Profile;

/// Frames over a `tokio_util` framed transport. Damage is an item of the stream and does not end it.
#[derive(Debug, Clone)]
pub struct Codec {
    decoder: Decoder,
    profile: Profile,
}

/// A frame that owns its payload.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OwnedFrame {
    payload: Bytes,
    profile: Profile,
}

impl Codec {
    /// A codec at the beginning of a stream.
    pub fn new(profile: &Profile) -> Self {
        Self { decoder: Decoder::new(profile), profile: *profile }
    }
}

impl OwnedFrame {
    /// The frame.
    pub fn frame(&self) -> Frame<'_> {
        Frame::new(&self.payload, &self.profile)
    }
}

impl tokio_util::codec::Decoder for Codec {
    type Item = Result<OwnedFrame, DecodeError>;
    type Error = io::Error;

    fn decode(&mut self, src: &mut BytesMut) -> io::Result<Option<Self::Item>> {
        loop {
            if let Some(frame) = self.decoder.next_frame() {
                let owned = |frame: Frame<'_>| OwnedFrame {
                    payload: Bytes::copy_from_slice(frame.payload()),
                    profile: self.profile,
                };
                return Ok(Some(frame.map(owned)));
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

impl tokio_util::codec::Encoder<Frame<'_>> for Codec {
    type Error = io::Error;

    fn encode(&mut self, frame: Frame<'_>, out: &mut BytesMut) -> io::Result<()> {
        frame.append_to(out);
        Ok(())
    }
}
