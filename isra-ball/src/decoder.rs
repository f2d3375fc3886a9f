use robot_session::StreamBuffer;

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
    /// With fewer bytes there is nothing to give yet.
    needed: usize,
    /// Why the first bytes are no packet. So many of them begin no header: those that are needed, less the three of a header.
    corruption: Option<DecodeError>,
    finished: bool,
}

impl Decoder {
    /// The longest run of bytes that one error covers: a header after it must fit the buffer.
    const MAX_SKIP: usize = Frame::MAX_LEN;

    /// An empty decoder.
    pub const fn new() -> Self {
        let buffer = StreamBuffer::new();
        Self { buffer, needed: Frame::OVERHEAD, corruption: None, finished: false }
    }

    #[inline(never)]
    fn next_item(&mut self) -> Option<Result<Frame<'_>, DecodeError>> {
        let bytes = self.buffer.bytes();
        if self.corruption.is_none() {
            let error = match Frame::decode(bytes) {
                Ok(Some((_, length))) => {
                    self.needed = Frame::OVERHEAD;
                    let data = self.buffer.take(length).get(3..length - 1)?;
                    return Frame::new(data).map(Ok);
                }
                Ok(None) => {
                    let n = *bytes.first()?;
                    let (expected, found) = (usize::from(n) + Frame::OVERHEAD, bytes.len());
                    if !self.finished {
                        self.needed = expected;
                        return None;
                    }
                    DecodeError::Incomplete { expected, found }
                }
                Err(error) => error,
            };
            (self.corruption, self.needed) = (Some(error), 1 + 3);
        }
        let length = self.corrupt_length()?;
        self.buffer.take(length);
        self.needed = Frame::OVERHEAD;
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

    /// Whether the last byte came alone, and ends no header: the corruption goes on.
    #[inline]
    fn passes(&mut self) -> bool {
        let [.., n, minus_n, _] = self.buffer.bytes() else { return false };
        let came_alone = self.corruption.is_some() && self.buffer.len() == self.needed;
        if !came_alone || self.needed >= Self::MAX_SKIP + 3 || n.wrapping_add(*minus_n) == 0 {
            return false;
        }
        self.needed += 1;
        true
    }

    /// How far the corruption reaches: to the next whole header, or to the end of a finished stream.
    fn corrupt_length(&mut self) -> Option<usize> {
        let bytes = self.buffer.bytes();
        let searched = self.needed - 3;
        let end = bytes.len().min(Self::MAX_SKIP + 2);
        let rest = bytes.get(searched..end).unwrap_or_default();
        match find_header(rest) {
            Some(at) => Some(searched + at),
            None if bytes.len() >= Self::MAX_SKIP + 3 => Some(Self::MAX_SKIP),
            None if self.finished => Some(bytes.len().min(Self::MAX_SKIP)),
            None => {
                self.needed += rest.len().saturating_sub(2);
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
        let waits = !self.finished && (self.buffer.len() < self.needed || self.passes());
        if waits { None } else { self.next_item() }
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
        (self.needed, self.corruption, self.finished) = (Frame::OVERHEAD, None, false);
    }
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}
