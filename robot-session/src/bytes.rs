//! A link whose messages are single bytes.

use core::convert::Infallible;

use crate::buffer::StreamBuffer;
use crate::decoder::Decoder;

/// A decoder for which every byte is a frame.
#[derive(Debug, Clone, Default)]
pub struct ByteDecoder {
    buffer: StreamBuffer<32>,
}

impl ByteDecoder {
    /// Creates an empty decoder.
    pub const fn new() -> Self {
        Self { buffer: StreamBuffer::new() }
    }
}

impl Decoder for ByteDecoder {
    type Frame<'a> = u8;
    type Error = Infallible;

    #[inline]
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.buffer.push(bytes)
    }

    #[inline]
    fn next_frame(&mut self) -> Option<Result<u8, Infallible>> {
        self.buffer.take(1).first().copied().map(Ok)
    }

    fn finish(&mut self) {}

    fn position(&self) -> u64 {
        self.buffer.position()
    }

    fn clear(&mut self) {
        self.buffer.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_is_a_frame_and_what_is_cleared_counts() {
        let mut decoder = ByteDecoder::new();
        assert_eq!(decoder.push(b"ab"), 2);
        assert_eq!((decoder.next_frame(), decoder.position()), (Some(Ok(b'a')), 1));
        decoder.clear();
        decoder.finish();
        assert_eq!((decoder.next_frame(), decoder.position()), (None, 2));
        assert_eq!((decoder.push(&[7; 40]), decoder.push(b"x")), (32, 0));
    }
}
