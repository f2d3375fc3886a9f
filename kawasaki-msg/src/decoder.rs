//! A stream of bytes in, messages out, wherever reads and string elements split the bytes.

use robot_session::end::StreamBuffer;

use crate::error::DecodeError;
use crate::frame::{Frame, Progress};
use crate::marks::START;
use crate::message::Message;
use crate::value::Charset;

/// Finds the messages in a stream of bytes.
///
/// The methods are those of [`robot_session::Decoder`]. A message may be split anywhere and by any number of reads. An error
/// costs the bytes up to the next `<`, and nothing before or after them; it is returned when that `<` has come. The decoder
/// buffers one message of at most `MESSAGE` bytes: a longer one is [`DecodeError::TooLong`].
///
/// ```
/// use kawasaki_msg::robot_session::Decoder as _;
/// use kawasaki_msg::{Charset, Decoder};
///
/// let mut decoder = Decoder::new(Charset::Ascii);
/// assert_eq!(decoder.push(b"<TilausKuit"), 11);
/// assert!(decoder.next_frame().is_none());
/// assert_eq!(decoder.push(b"taus$2#50#>"), 11);
/// assert_eq!(decoder.next_frame().expect("whole")?.name, "TilausKuittaus");
/// # Ok::<(), kawasaki_msg::DecodeError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Decoder<const MESSAGE: usize = { Message::MAX_LEN }> {
    buffer: StreamBuffer<MESSAGE>,
    charset: Charset,
    /// The progress in the message that the buffer begins with.
    progress: Progress,
    /// The number of bytes before the buffer that no returned item covers.
    skipped: u64,
    /// The reason that they are skipped; `None`: they are garbage.
    corruption: Option<DecodeError>,
    finished: bool,
}

impl Decoder {
    /// Creates an empty decoder at the beginning of a stream, for messages of any length.
    pub const fn new(charset: Charset) -> Self {
        Self::sized(charset)
    }
}

impl<const MESSAGE: usize> Decoder<MESSAGE> {
    /// Creates an empty decoder at the beginning of a stream, for messages of `MESSAGE` bytes at most.
    pub const fn sized(charset: Charset) -> Self {
        let buffer = StreamBuffer::new();
        Self { buffer, charset, progress: Progress::NONE, skipped: 0, corruption: None, finished: false }
    }

    /// Returns whether the bytes so far end inside a message that may still become whole.
    pub fn is_inside_message(&self) -> bool {
        !self.buffer.is_empty()
    }

    /// Returns the next message or error.
    #[inline(never)]
    fn next_item(&mut self) -> Option<Result<Message<'_>, DecodeError>> {
        if self.skipped == 0 && self.buffer.bytes().first() == Some(&START) {
            match Frame::decode(self.buffer.bytes(), self.charset, MESSAGE, &mut self.progress) {
                Ok(Some(frame)) => return Some(Ok(self.take(frame))),
                Ok(None) if !self.finished => return None,
                read => self.corrupt(read.err()),
            }
        }
        self.find_start().map(Err)
    }

    /// Removes a message.
    #[inline(always)]
    fn take(&mut self, frame: Frame) -> Message<'_> {
        self.progress = Progress::NONE;
        Message::of(frame, self.buffer.take(frame.len()))
    }

    /// Skips the first byte, since the bytes do not begin with a message.
    #[cold]
    fn corrupt(&mut self, error: Option<DecodeError>) {
        let error = error.unwrap_or(DecodeError::Incomplete { offset: 0, found: self.buffer.len() });
        self.corruption = Some(error.moved(offset(self.buffer.position())));
        self.skip(1);
    }

    /// Goes to the next `<`, and returns the error that covers the skipped bytes; `None` if it has not come.
    #[inline(never)]
    fn find_start(&mut self) -> Option<DecodeError> {
        let bytes = self.buffer.bytes();
        self.skip(bytes.iter().position(|byte| *byte == START).unwrap_or(bytes.len()));
        if self.buffer.is_empty() && !self.finished {
            return None;
        }
        if self.skipped == 0 {
            self.finished = false;
            return None;
        }
        let offset = offset(robot_session::Decoder::position(self));
        let length = usize::try_from(core::mem::take(&mut self.skipped)).unwrap_or(usize::MAX);
        Some(self.corruption.take().unwrap_or(DecodeError::Garbage { offset, length }))
    }

    fn skip(&mut self, length: usize) {
        self.progress = Progress::NONE;
        self.buffer.take(length);
        self.skipped += length as u64;
    }
}

impl<const MESSAGE: usize> robot_session::Decoder for Decoder<MESSAGE> {
    type Frame<'a> = Message<'a>;
    type Error = DecodeError;

    #[inline]
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.buffer.push(bytes)
    }

    #[inline(always)] // most messages are whole
    fn next_frame(&mut self) -> Option<Result<Message<'_>, DecodeError>> {
        let whole = if self.progress.known == 0 && self.skipped == 0 {
            Frame::whole(self.buffer.bytes(), self.charset, MESSAGE)
        } else {
            None
        };
        match whole {
            Some(frame) => Some(Ok(self.take(frame))),
            None => self.next_item(),
        }
    }

    fn finish(&mut self) {
        // Examine the held bytes once more, as the last of the stream.
        (self.progress, self.finished) = (Progress::NONE, true);
    }

    fn position(&self) -> u64 {
        self.buffer.position() - self.skipped
    }

    fn clear(&mut self) {
        self.buffer.clear();
        (self.progress, self.skipped, self.corruption, self.finished) = (Progress::NONE, 0, None, false);
    }
}

/// Returns the offset of an error.
#[expect(clippy::cast_possible_truncation, reason = "the offset of an error wraps")]
const fn offset(position: u64) -> usize {
    position as usize
}
