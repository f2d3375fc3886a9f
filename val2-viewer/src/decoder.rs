use robot_session::end::StreamBuffer;

use crate::error::DecodeError;
use crate::message::PosePacket;

/// Bytes in, poses out, also after corrupt bytes. The verbs are those of [`robot_session::Decoder`].
///
/// A line begins with its only `$`, and ends with its line feed. An error covers a whole line, or all bytes up to the next
/// `$`: corruption costs only the packets that it touched.
#[derive(Debug, Clone)]
pub struct Decoder {
    buffer: StreamBuffer<256>,
    /// The number of bytes without an end of the first line and without a beginning of another.
    searched: usize,
    /// The number of bytes that are an item in any case: [`PosePacket::MAX_LEN`], and one once the stream has ended.
    limit: usize,
}

impl Decoder {
    /// Creates an empty decoder.
    pub const fn new() -> Self {
        Self { buffer: StreamBuffer::new(), searched: 0, limit: PosePacket::MAX_LEN }
    }

    #[inline(never)]
    fn next_item(&mut self) -> Option<Result<PosePacket, DecodeError>> {
        let bytes = self.buffer.bytes();
        let window = bytes.get(..PosePacket::MAX_LEN).unwrap_or(bytes);
        let begin = self.searched.max(1);
        let is_end = |byte: &u8| matches!(byte, b'\n' | b'$');
        let end = match window.first() {
            Some(b'\n') => Some(0),
            _ => window.get(begin..).unwrap_or_default().iter().position(is_end).map(|at| begin + at),
        };
        if end.is_none() && window.len() < self.limit {
            self.searched = window.len();
            return None;
        }
        let (length, item) = item(window, end);
        self.searched = 0;
        self.buffer.take(length);
        Some(item)
    }
}

impl robot_session::Decoder for Decoder {
    type Frame<'a> = PosePacket;
    type Error = DecodeError;

    #[inline]
    fn push(&mut self, bytes: &[u8]) -> usize {
        let taken = self.buffer.push(bytes);
        if taken > 0 {
            self.limit = PosePacket::MAX_LEN;
        }
        taken
    }

    #[inline]
    fn next_frame(&mut self) -> Option<Result<PosePacket, DecodeError>> {
        if self.buffer.is_empty() { None } else { self.next_item() }
    }

    fn finish(&mut self) {
        self.limit = 1;
    }

    fn position(&self) -> u64 {
        self.buffer.position()
    }

    fn clear(&mut self) {
        self.buffer.clear();
        (self.searched, self.limit) = (0, PosePacket::MAX_LEN);
    }
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

/// Returns the first line, or the error of the bytes before the next possible beginning of a line, and their length. `end`
/// is the offset at which the line ends or another one begins.
fn item(window: &[u8], end: Option<usize>) -> (usize, Result<PosePacket, DecodeError>) {
    let is_line = window.first() == Some(&b'$');
    let length = match end {
        Some(at) if window.get(at) == Some(&b'\n') => {
            let length = at + 1;
            let item = match PosePacket::decode(window.get(..length).unwrap_or_default()) {
                Ok(Some((packet, _))) => Ok(packet),
                Ok(None) => Err(DecodeError::Format { offset: length }),
                Err(error) => Err(error),
            };
            return (length, item);
        }
        Some(at) => at,
        None if window.len() == PosePacket::MAX_LEN && is_line => {
            let limit = PosePacket::MAX_LEN;
            return (limit, Err(DecodeError::TooLong { limit }));
        }
        None => window.len(),
    };
    let error = if is_line { DecodeError::Incomplete { length } } else { DecodeError::Noise { length } };
    (length, Err(error))
}
