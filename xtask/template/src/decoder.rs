use robot_session::end::StreamBuffer;

use crate::error::DecodeError;
use crate::message::Message;

/// Bytes in, lines out, also after corrupt bytes. The verbs are those of [`robot_session::Decoder`].
///
/// An error covers a whole line, so corruption costs no line but those that it touched.
#[derive(Debug, Clone, Default)]
pub struct Decoder {
    buffer: StreamBuffer<64>,
    /// The number of bytes that do not end a line.
    searched: usize,
    finished: bool,
}

impl Decoder {
    /// Creates an empty decoder.
    pub const fn new() -> Self {
        Self { buffer: StreamBuffer::new(), searched: 0, finished: false }
    }
}

impl robot_session::Decoder for Decoder {
    type Frame<'a> = Message;
    type Error = DecodeError;

    fn push(&mut self, bytes: &[u8]) -> usize {
        let taken = self.buffer.push(bytes);
        self.finished &= taken == 0;
        taken
    }

    fn next_frame(&mut self) -> Option<Result<Message, DecodeError>> {
        let bytes = self.buffer.bytes();
        let window = bytes.get(..Message::MAX_LEN).unwrap_or(bytes);
        let unsearched = window.get(self.searched..).unwrap_or_default();
        let end = unsearched.iter().position(|byte| *byte == b'\n').map(|at| self.searched + at);
        let (length, item) = match end {
            Some(end) => (end + 1, Message::decode(window.get(..end).unwrap_or_default())),
            None if window.len() == Message::MAX_LEN => {
                (window.len(), Err(DecodeError::TooLong { length: window.len() }))
            }
            None if self.finished && !window.is_empty() => {
                (window.len(), Err(DecodeError::Incomplete { length: window.len() }))
            }
            None => {
                self.searched = window.len();
                return None;
            }
        };
        self.searched = 0;
        self.buffer.take(length);
        Some(item)
    }

    fn finish(&mut self) {
        self.finished = !self.buffer.is_empty();
    }

    fn position(&self) -> u64 {
        self.buffer.position()
    }

    fn clear(&mut self) {
        self.buffer.clear();
        (self.searched, self.finished) = (0, false);
    }
}
