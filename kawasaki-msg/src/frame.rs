//! The envelope: `< name $ header $ … length # data # >`.

use crate::error::{DecodeError, EncodeError};
use crate::number;
use crate::value::{Charset, DATA, END, SEPARATOR, START, Value};

/// Where the parts of a message are, from its `<` on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Frame {
    /// The end of the name, which begins after the `<`.
    name: usize,
    /// The end of the values between the name and the length: the `$` before the length.
    header: usize,
    /// The beginning of the data part.
    data: usize,
    /// Its end.
    end: usize,
}

/// How far the message is known that some bytes begin with. More of them go on from here: what was looked at is not looked at again.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Progress {
    /// How many bytes hold nothing that ends the part of the message that they are in.
    pub(crate) known: usize,
    /// What they say, from the first `#` on.
    frame: Option<Frame>,
}

impl Frame {
    /// Looks at the bytes from a `<` on, as far as they have come; of more than `limit` no message has. `None`: more bytes are needed.
    ///
    /// # Errors
    /// The first corruption, with its place in `bytes`.
    #[inline]
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
                if bytes.get(end) != Some(&DATA) {
                    return Err(wrong(bytes, end, charset));
                }
                let frame = Self::read(bytes.get(..end).unwrap_or_default(), limit)?;
                *progress = Progress { known: frame.data, frame: Some(frame) };
                if frame.data == bytes.len() {
                    return more(bytes, limit);
                }
                frame
            }
        };
        let Some(end) = progress.text_end(bytes, charset) else { return more(bytes, limit) };
        match bytes.get(end..end + 2) {
            Some(&[DATA, END]) if end == frame.end => Ok(Some(frame)),
            _ => frame.lacks(bytes, end, charset).map_or_else(|| more(bytes, limit), Err),
        }
    }

    /// What is wrong where the data part ends at this place.
    #[cold]
    fn lacks(&self, bytes: &[u8], end: usize, charset: Charset) -> Option<DecodeError> {
        let (expected, found) = (self.end - self.data, end - self.data);
        if bytes.get(end) != Some(&DATA) {
            return Some(wrong(bytes, end, charset));
        }
        if found != expected {
            return Some(DecodeError::Length { offset: self.data, expected, found });
        }
        match *bytes.get(end + 1)? {
            START => Some(DecodeError::Mark { offset: end + 1, found: START }),
            found => Some(DecodeError::NoEndMark { offset: end + 1, found }),
        }
    }

    /// Reads `< name $ header $ length`: the last value is the length, what is before it is kept (thesis, section 10.1).
    fn read(bytes: &[u8], limit: usize) -> Result<Self, DecodeError> {
        let no_length = |offset| DecodeError::NoLength { offset };
        let header = bytes.iter().rposition(|byte| *byte == SEPARATOR).ok_or(no_length(bytes.len()))?;
        let length = number::parse(bytes.get(header + 1..).unwrap_or_default(), 0).ok();
        let length = length.and_then(|n| usize::try_from(n).ok()).ok_or(no_length(header + 1))?;
        let name = bytes.iter().position(|byte| *byte == SEPARATOR).unwrap_or(header);
        if name == 1 {
            return Err(DecodeError::NoName { offset: 1 });
        }
        let data = bytes.len() + 1;
        let frame = Self { name, header, data, end: data + length };
        if frame.len() > limit { Err(DecodeError::TooLong { offset: 1, limit }) } else { Ok(frame) }
    }

    /// How many bytes the message has.
    pub(crate) const fn len(&self) -> usize {
        self.end + "#>".len()
    }

    /// Name, values between name and length, and data of the message that these bytes are.
    #[inline]
    pub(crate) fn parts<'a>(&self, bytes: &'a [u8]) -> (&'a [u8], Option<&'a [u8]>, &'a [u8]) {
        let part = |from, to| bytes.get(from..to);
        let (name, data) = (part(1, self.name), part(self.data, self.end));
        (name.unwrap_or_default(), part(self.name + 1, self.header), data.unwrap_or_default())
    }

    /// Writes a message: its name and what is between it and the length, then the fields of its data part.
    pub(crate) fn encode<'o>(
        out: &'o mut [u8],
        charset: Charset,
        header: impl FnOnce(&mut Writer<'o>),
        data: impl FnOnce(&mut Writer<'o>),
    ) -> Written {
        let mut writer = Writer { out, length: 0, mark: START, charset, error: None };
        header(&mut writer);
        writer.field();
        let length_at = writer.length;
        // Most lengths have two digits.
        writer.length += 2;
        writer.mark = DATA;
        let data_at = writer.length + 1;
        data(&mut writer);
        if writer.mark == DATA {
            writer.push(DATA);
        }
        writer.set_length(length_at, writer.length - data_at);
        writer.push(DATA);
        writer.push(END);
        Written { length: writer.length, available: writer.out.len(), error: writer.error }
    }
}

impl Progress {
    /// Nothing is known.
    pub(crate) const NONE: Self = Self { known: 0, frame: None };

    /// Where the part ends that is known to its beginning. `None`: its end has not come.
    #[inline(always)]
    fn text_end(&mut self, bytes: &[u8], charset: Charset) -> Option<usize> {
        // The first byte is the `<`.
        let from = self.known.max(1);
        let end = charset.text_end(bytes.get(from..).unwrap_or_default());
        self.known = end.map_or(bytes.len(), |end| from + end);
        end.map(|_| self.known)
    }
}

/// More bytes are needed.
fn more(bytes: &[u8], limit: usize) -> Result<Option<Frame>, DecodeError> {
    if bytes.len() < limit { Ok(None) } else { Err(DecodeError::TooLong { offset: 0, limit }) }
}

/// What is wrong with a byte that is in place of a `#`.
#[cold]
fn wrong(bytes: &[u8], offset: usize, charset: Charset) -> DecodeError {
    let found = bytes.get(offset).copied().unwrap_or(DATA);
    if charset.has(found) {
        DecodeError::Mark { offset, found }
    } else {
        DecodeError::NotAscii { offset, found }
    }
}

/// Writes the fields of a message, each with the mark before it. What the buffer has no room for is counted.
pub(crate) struct Writer<'o> {
    out: &'o mut [u8],
    length: usize,
    /// What is before the next field.
    mark: u8,
    charset: Charset,
    error: Option<EncodeError>,
}

/// What was written.
pub(crate) struct Written {
    /// How many bytes the message has, whether they are there or not.
    pub(crate) length: usize,
    /// How many the buffer has.
    available: usize,
    /// The first field or character that cannot be in a message.
    pub(crate) error: Option<EncodeError>,
}

impl Writer<'_> {
    /// Begins the next field.
    pub(crate) fn field(&mut self) {
        self.push(self.mark);
        self.mark = SEPARATOR;
    }

    /// A field of text.
    pub(crate) fn text(&mut self, text: impl Iterator<Item = char>) {
        self.field();
        for c in text {
            match self.charset.byte(c) {
                Ok(byte) => self.push(byte),
                Err(error) => {
                    self.refuse(error);
                    self.length += 1;
                }
            }
        }
    }

    /// A field with a number of this many decimals.
    pub(crate) fn number(&mut self, number: i32, places: u8) {
        let length = 1 + number::len(number, places);
        if let Some([mark, place @ ..]) = self.out.get_mut(self.length..self.length + length) {
            *mark = self.mark;
            number::write(number, places, place);
        }
        self.mark = SEPARATOR;
        self.length += length;
    }

    pub(crate) fn value(&mut self, value: &Value<'_>) {
        match *value {
            Value::Number(number) => self.number(number, 0),
            Value::Text(text) => self.text(text.chars()),
            Value::Wire(bytes) => self.text(bytes.iter().map(|byte| char::from(*byte))),
        }
    }

    /// The message cannot be written, if not for an earlier reason.
    pub(crate) fn refuse(&mut self, error: EncodeError) {
        self.error.get_or_insert(error);
    }

    pub(crate) const fn charset(&self) -> Charset {
        self.charset
    }

    fn push(&mut self, byte: u8) {
        if let Some(place) = self.out.get_mut(self.length) {
            *place = byte;
        }
        self.length += 1;
    }

    /// Writes the length of the data part to its place, which has two bytes: another length moves what follows.
    fn set_length(&mut self, at: usize, data: usize) {
        // No buffer is longer.
        let data = i32::try_from(data).unwrap_or(i32::MAX);
        let digits = number::len(data, 0);
        let end = self.length - 2 + digits;
        if digits != 2 && self.length.max(end) <= self.out.len() {
            self.out.copy_within(at + 2..self.length, at + digits);
        }
        self.length = end;
        if let Some(place) = self.out.get_mut(at..at + digits) {
            number::write(data, 0, place);
        }
    }
}

impl Written {
    /// The message's length, if it is in the buffer.
    pub(crate) fn fit(&self, limit: usize) -> Result<usize, EncodeError> {
        let Self { length, available, .. } = *self;
        match length {
            _ if length > limit => Err(EncodeError::TooLong { length, limit }),
            _ if length > available => Err(EncodeError::BufferTooSmall { needed: length, available }),
            _ => Ok(length),
        }
    }
}
