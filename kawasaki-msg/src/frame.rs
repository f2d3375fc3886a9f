//! The envelope: `< name $ header $ … length # data # >`.

use crate::error::DecodeError;
use crate::value::{Charset, DATA, END, SEPARATOR, START, Value, Values};

/// The offsets of a message's parts from its `<` on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Frame {
    /// The first `$`, after the name.
    name: usize,
    /// The last `$`, before the length.
    header: usize,
    /// The first byte of the data part, after a `#`.
    data: usize,
    /// The `#` after the data part.
    end: usize,
}

/// The part of a message that is read already: with more bytes, reading goes on from there.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Progress {
    /// The number of bytes that do not end the part of the message that they are in.
    pub(crate) known: usize,
    /// The parts, once the header is read.
    frame: Option<Frame>,
}

impl Progress {
    /// No byte is read.
    pub(crate) const NONE: Self = Self { known: 0, frame: None };

    /// Returns the offset of the byte that ends the part which is known up to here; `None` if it has not come.
    fn text_end(&mut self, bytes: &[u8], charset: Charset) -> Option<usize> {
        // The first byte is the `<`.
        let from = self.known.max(1);
        let end = charset.text_end(bytes.get(from..).unwrap_or_default());
        self.known = end.map_or(bytes.len(), |end| from + end);
        end.map(|_| self.known)
    }
}

impl Frame {
    /// Reads the message that begins with the first byte, a `<`; it has `limit` bytes at most. `None`: more bytes are needed.
    ///
    /// # Errors
    /// The first corruption, with its offset in `bytes`.
    #[inline(always)]
    pub(crate) fn decode(
        bytes: &[u8],
        charset: Charset,
        limit: usize,
        progress: &mut Progress,
    ) -> Result<Option<Self>, DecodeError> {
        let frame = match progress.frame {
            Some(frame) => frame,
            None => {
                // Bytes that end nothing are looked at once until the `#` has come.
                if progress.known > 1 && progress.text_end(bytes, charset).is_none() {
                    return more(bytes, limit);
                }
                let Some(frame) = Self::header(bytes, charset, limit)? else {
                    progress.known = bytes.len();
                    return more(bytes, limit);
                };
                frame
            }
        };
        match bytes.get(frame.data..frame.len()) {
            Some([data @ .., DATA, END]) if charset.is_text(data) => Ok(Some(frame)),
            _ => frame.unfinished(bytes, charset, limit, progress),
        }
    }

    /// Reads `< name $ header $ length #`: the last value is the length, the values before it are kept (thesis, section 10.1).
    /// `None`: the `#` has not come.
    #[inline(always)]
    fn header(bytes: &[u8], charset: Charset, limit: usize) -> Result<Option<Self>, DecodeError> {
        let (mut name, mut header, mut at) = (0, 0, 1);
        let found = loop {
            let Some(byte) = bytes.get(at) else { return Ok(None) };
            if *byte == SEPARATOR {
                name = if name == 0 { at } else { name };
                header = at;
            } else if charset.ends_text(*byte) {
                break *byte;
            }
            at += 1;
        };
        if found != DATA {
            return Err(wrong(found, at, charset));
        }
        if header == 0 {
            return Err(DecodeError::NoLength { offset: at });
        }
        let mut length = Values(bytes.get(header + 1..=at).unwrap_or_default());
        let length = length.number(0).and_then(Result::ok).and_then(|length| usize::try_from(length).ok());
        let Some(length) = length else { return Err(DecodeError::NoLength { offset: header + 1 }) };
        if name == 1 {
            return Err(DecodeError::NoName { offset: 1 });
        }
        let frame = Self { name, header, data: at + 1, end: at + 1 + length };
        if frame.len() > limit { Err(DecodeError::TooLong { offset: 1, limit }) } else { Ok(Some(frame)) }
    }

    /// The data part is not whole, or not what the header says.
    #[cold]
    #[inline(never)]
    fn unfinished(
        self,
        bytes: &[u8],
        charset: Charset,
        limit: usize,
        progress: &mut Progress,
    ) -> Result<Option<Self>, DecodeError> {
        *progress = Progress { known: progress.known.max(self.data), frame: Some(self) };
        let Some(end) = progress.text_end(bytes, charset) else { return more(bytes, limit) };
        let (expected, found) = (self.end - self.data, end - self.data);
        match (bytes.get(end), bytes.get(end + 1)) {
            (Some(&DATA), _) if found != expected => {
                Err(DecodeError::Length { offset: self.data, expected, found })
            }
            (Some(&DATA), None) => more(bytes, limit),
            (Some(&DATA), Some(&START)) => Err(DecodeError::Mark { offset: end + 1, found: START }),
            (Some(&DATA), Some(found)) => Err(DecodeError::NoEndMark { offset: end + 1, found: *found }),
            (found, _) => Err(wrong(found.copied().unwrap_or(DATA), end, charset)),
        }
    }

    /// The number of bytes that the message has.
    #[inline(always)]
    pub(crate) const fn len(&self) -> usize {
        self.end + "#>".len()
    }

    /// Returns the name, the values between name and length, and the fields of the message that these bytes are.
    #[inline(always)]
    pub(crate) fn parts<'a>(&self, bytes: &'a [u8]) -> (Value<'a>, Values<'a>, Values<'a>) {
        let part = |from, to| bytes.get(from..to).unwrap_or_default();
        // No value and one empty value are the same bytes.
        let end = if self.data == self.end { self.data } else { self.end + 1 };
        (
            Value(part(1, self.name)),
            Values(part(self.name + 1, self.header + 1)),
            Values(part(self.data, end)),
        )
    }
}

/// More bytes are needed.
fn more(bytes: &[u8], limit: usize) -> Result<Option<Frame>, DecodeError> {
    if bytes.len() < limit { Ok(None) } else { Err(DecodeError::TooLong { offset: 0, limit }) }
}

/// The error of a byte that is in place of a `#`.
#[cold]
const fn wrong(found: u8, offset: usize, charset: Charset) -> DecodeError {
    if charset.has(found) {
        DecodeError::Mark { offset, found }
    } else {
        DecodeError::NotAscii { offset, found }
    }
}
