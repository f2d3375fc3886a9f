use robot_session::end::StreamBuffer;

use crate::envelope::find_header;
use crate::error::DecodeError;
use crate::frame::Frame;

/// Bytes in, packets out, also after corrupt bytes. The verbs are those of [`robot_session::Decoder`].
///
/// An error covers everything up to the next packet header, so corruption costs one error and no packet but those it touched. A
/// packet whose checksum fails is searched again from its second byte. An error is therefore given only when that header has
/// come, or after `finish`.
#[derive(Debug, Clone)]
pub struct Decoder {
    buffer: StreamBuffer<512>,
    /// The error of the first bytes; `None` if they may be a packet.
    corruption: Option<DecodeError>,
    /// The number of these bytes that do not begin a header.
    searched: usize,
    finished: bool,
}

impl Decoder {
    /// The longest run of bytes that one error covers: a header after it must fit the buffer.
    const MAX_SKIP: usize = Frame::MAX_LEN;

    /// Creates an empty decoder.
    pub const fn new() -> Self {
        let buffer = StreamBuffer::new();
        Self { buffer, corruption: None, searched: 0, finished: false }
    }

    #[inline(never)]
    fn next_item(&mut self) -> Option<Result<Frame<'_>, DecodeError>> {
        let bytes = self.buffer.bytes();
        if self.corruption.is_none() {
            let error = match Frame::decode(bytes) {
                Ok(Some((_, length))) => {
                    let data = self.buffer.take(length).get(3..length - 1)?;
                    return Frame::new(data).map(Ok);
                }
                Ok(None) => {
                    let n = *bytes.first()?;
                    let (expected, found) = (usize::from(n) + Frame::OVERHEAD, bytes.len());
                    if !self.finished {
                        return None;
                    }
                    DecodeError::Incomplete { expected, found }
                }
                Err(error) => error,
            };
            (self.corruption, self.searched) = (Some(error), 1);
        }
        let length = self.corrupt_length()?;
        self.buffer.take(length);
        self.corruption.take().map(|error| {
            Err(match error {
                DecodeError::Header { .. } => DecodeError::Noise { length },
                DecodeError::Incomplete { expected, .. } => {
                    DecodeError::Incomplete { expected, found: length }
                }
                error => error,
            })
        })
    }

    /// Returns the length of the corruption: to the next whole header, or to the end of a finished stream. `None`:
    /// more bytes are needed.
    fn corrupt_length(&mut self) -> Option<usize> {
        let bytes = self.buffer.bytes();
        let searched = self.searched;
        let end = bytes.len().min(Self::MAX_SKIP + 2);
        let rest = bytes.get(searched..end).unwrap_or_default();
        match find_header(rest) {
            Some(at) => Some(searched + at),
            None if bytes.len() >= Self::MAX_SKIP + 3 => Some(Self::MAX_SKIP),
            None if self.finished => Some(bytes.len().min(Self::MAX_SKIP)),
            None => {
                self.searched += rest.len().saturating_sub(2);
                None
            }
        }
    }
}

impl robot_session::Decoder for Decoder {
    type Frame<'a> = Frame<'a>;
    type Error = DecodeError;

    #[inline]
    fn push(&mut self, bytes: &[u8]) -> usize {
        let taken = self.buffer.push(bytes);
        self.finished &= bytes.is_empty();
        taken
    }

    #[inline]
    fn next_frame(&mut self) -> Option<Result<Frame<'_>, DecodeError>> {
        if self.buffer.is_empty() { None } else { self.next_item() }
    }

    #[inline]
    fn finish(&mut self) {
        self.finished = !self.buffer.is_empty();
    }

    fn position(&self) -> u64 {
        self.buffer.position()
    }

    fn clear(&mut self) {
        self.buffer.clear();
        (self.corruption, self.finished) = (None, false);
    }
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}
