use crate::decoder::Decoder;
use crate::error::DecodeError;
use crate::flow::{XOFF, XON};
use crate::message::PosePacket;

/// The lines of a stream, and its XON and XOFF, which are taken out of it wherever they are.
///
/// An XON or XOFF within a line comes before it. Offsets in the line and lengths do not count it; the position in the stream
/// does.
#[derive(Debug, Clone, Default)]
pub struct HandshakeDecoder {
    lines: Decoder,
    /// The last one that was taken out, after all that the lines have before it.
    next: Option<StreamItem>,
    taken_out: u64,
}

/// An item of the stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StreamItem {
    /// A packet with a pose.
    Packet(PosePacket),
    /// XON: the host releases the line.
    Xon,
    /// XOFF: the host holds the line.
    Xoff,
}

impl robot_session::Decoder for HandshakeDecoder {
    type Frame<'a> = StreamItem;
    type Error = DecodeError;

    fn push(&mut self, bytes: &[u8]) -> usize {
        if self.next.is_some() {
            return 0;
        }
        self.next = match bytes.first() {
            Some(&XON) => Some(StreamItem::Xon),
            Some(&XOFF) => Some(StreamItem::Xoff),
            _ => {
                let end = bytes.iter().position(|byte| matches!(*byte, XON | XOFF));
                return self.lines.push(end.and_then(|end| bytes.get(..end)).unwrap_or(bytes));
            }
        };
        self.taken_out += 1;
        1
    }

    fn next_frame(&mut self) -> Option<Result<StreamItem, DecodeError>> {
        match self.lines.next_frame() {
            Some(item) => Some(item.map(StreamItem::Packet)),
            None => self.next.take().map(Ok),
        }
    }

    fn finish(&mut self) {
        self.lines.finish();
    }

    fn position(&self) -> u64 {
        self.lines.position() + self.taken_out
    }

    fn clear(&mut self) {
        self.lines.clear();
        self.next = None;
    }
}

#[cfg(test)]
mod tests {
    use robot_session::Decoder as _;

    use super::*;

    #[test]
    fn the_handshake_comes_in_its_order() {
        let mut decoder = HandshakeDecoder::default();
        assert_eq!(decoder.push(b"a\nb\x13\x11"), 3);
        assert_eq!((decoder.push(b"\x13\x11"), decoder.push(b"\x11"), decoder.push(b"c")), (1, 0, 0));
        assert_eq!(decoder.next_frame(), Some(Err(DecodeError::Format { offset: 0 })));
        assert_eq!((decoder.next_frame(), decoder.next_frame()), (Some(Ok(StreamItem::Xoff)), None));
        assert_eq!((decoder.push(b"\x11"), decoder.next_frame()), (1, Some(Ok(StreamItem::Xon))));
        assert_eq!((decoder.push(b"\x11"), decoder.position()), (1, 5));
        decoder.clear();
        assert_eq!((decoder.next_frame(), decoder.push(b"c"), decoder.position()), (None, 1, 6));
        decoder.finish();
        assert_eq!(decoder.next_frame(), Some(Err(DecodeError::Noise { length: 1 })));
    }
}
