//! The envelope: `< name $ header $ … length # data # >`.

use crate::error::DecodeError;
use crate::marks::{DATA, END, SEPARATOR, START};
use crate::number;
use crate::value::{Charset, Value, Values};

/// The most bytes that a message can have: those of the longest packet (thesis, section 9.5).
pub(crate) const MAX_LEN: usize = 4096;

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

/// The part of a message that is read already: with more bytes, reading continues from there.
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
    /// Returns the message that begins with the first byte if it is whole, has no values between name and length, and is not
    /// corrupt, as most messages. Examines each byte once.
    #[inline(always)]
    pub(crate) fn whole(bytes: &[u8], charset: Charset, limit: usize) -> Option<Self> {
        let [START, after_start @ ..] = bytes else { return None };
        let name = 1 + after_start.iter().position(|byte| charset.ends_letters(*byte))?;
        let [SEPARATOR, rest @ ..] = bytes.get(name..)? else { return None };
        let (length, [DATA, after @ ..]) = number::plain(rest, 0)? else { return None };
        let (data, length) = (bytes.len() - after.len(), usize::try_from(length).ok()?);
        let frame = Self { name, header: name, data, end: data + length };
        let [text @ .., DATA, END] = after.get(..length + "#>".len())? else { return None };
        (name > 1 && frame.len() <= limit && charset.is_text(text)).then_some(frame)
    }

    /// Reads the message that begins with the first byte, a `<`, and has at most `limit` bytes. `None`: more bytes are
    /// needed.
    ///
    /// # Errors
    /// The first corruption, with its offset in `bytes`.
    #[inline(never)]
    pub(crate) fn decode(
        bytes: &[u8],
        charset: Charset,
        limit: usize,
        progress: &mut Progress,
    ) -> Result<Option<Self>, DecodeError> {
        let frame = match progress.frame {
            Some(frame) => frame,
            None => {
                let Some(end) = progress.text_end(bytes, charset) else { return more(bytes, limit) };
                let frame = Self::header(bytes, end, charset)?;
                if frame.len() > limit {
                    return Err(DecodeError::TooLong { offset: 1, limit });
                }
                *progress = Progress { known: frame.data, frame: Some(frame) };
                frame
            }
        };
        match progress.text_end(bytes, charset) {
            Some(end) => frame.check(bytes, end, charset, limit),
            None => more(bytes, limit),
        }
    }

    /// Reads `< name $ header $ length`, which ends at this offset: the last value is the length, the values before it are
    /// stored (thesis, section 10.1).
    fn header(bytes: &[u8], end: usize, charset: Charset) -> Result<Self, DecodeError> {
        if bytes.get(end) != Some(&DATA) {
            return Err(wrong(bytes, end, charset));
        }
        let text = bytes.get(..end).unwrap_or_default();
        let no_length = |offset| DecodeError::NoLength { offset };
        let header = text.iter().rposition(|byte| *byte == SEPARATOR).ok_or(no_length(end))?;
        let length = number::parse(text.get(header + 1..).unwrap_or_default(), 0).ok();
        let length = length.and_then(|length| usize::try_from(length).ok()).ok_or(no_length(header + 1))?;
        let name = text.iter().position(|byte| *byte == SEPARATOR).unwrap_or(header);
        if name == 1 {
            return Err(DecodeError::NoName { offset: 1 });
        }
        Ok(Self { name, header, data: end + 1, end: end + 1 + length })
    }

    /// Checks a message whose data part ends at this offset.
    fn check(
        self,
        bytes: &[u8],
        end: usize,
        charset: Charset,
        limit: usize,
    ) -> Result<Option<Self>, DecodeError> {
        let (expected, found) = (self.end - self.data, end - self.data);
        if bytes.get(end) != Some(&DATA) {
            return Err(wrong(bytes, end, charset));
        }
        match bytes.get(end + 1).copied() {
            _ if found != expected => Err(DecodeError::Length { offset: self.data, expected, found }),
            Some(END) => Ok(Some(self)),
            Some(START) => Err(DecodeError::Mark { offset: end + 1, found: START }),
            Some(found) => Err(DecodeError::NoEndMark { offset: end + 1, found }),
            None => more(bytes, limit),
        }
    }

    /// Returns the number of bytes that the message has.
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
        let header = if self.name == self.header { &[] } else { part(self.name + 1, self.header + 1) };
        (Value(part(1, self.name)), Values(header), Values(part(self.data, end)))
    }
}

/// Returns `None` if more bytes are needed, or an error if the message is longer than `limit`.
fn more(bytes: &[u8], limit: usize) -> Result<Option<Frame>, DecodeError> {
    if bytes.len() < limit { Ok(None) } else { Err(DecodeError::TooLong { offset: 0, limit }) }
}

/// Returns the error of a byte that is in place of a `#`.
fn wrong(bytes: &[u8], offset: usize, charset: Charset) -> DecodeError {
    let found = bytes.get(offset).copied().unwrap_or(DATA);
    if charset.has(found) {
        DecodeError::Mark { offset, found }
    } else {
        DecodeError::NotAscii { offset, found }
    }
}
