//! Writes one message.

use crate::error::EncodeError;
use crate::frame::MAX_LEN;
use crate::marks::{DATA, END, SEPARATOR, START, is_mark};
use crate::number;
use crate::value::Charset;

/// Writes one message into a buffer: the name, the values between name and length, then the fields.
///
/// ```
/// use kawasaki_msg::{Charset, Message, Writer};
///
/// let mut wire = [0; 64];
/// let mut writer = Writer::new(&mut wire, Charset::Ascii, "TilausAlkaa");
/// writer.data();
/// writer.number(50, 0);
/// writer.text("A1");
/// let length = writer.finish()?;
/// assert_eq!(&wire[..length], b"<TilausAlkaa$5#50$A1#>");
/// # Ok::<(), kawasaki_msg::EncodeError>(())
/// ```
#[derive(Debug)]
pub struct Writer<'o> {
    out: &'o mut [u8],
    /// The number of bytes so far, including those that do not fit the buffer.
    length: usize,
    /// The mark before the next value.
    mark: u8,
    /// The offset of the data part's length; 0 until the header ends.
    length_at: usize,
    charset: Charset,
    error: Option<EncodeError>,
}

impl<'o> Writer<'o> {
    /// Begins a message of this name.
    #[inline]
    pub fn new(out: &'o mut [u8], charset: Charset, name: &str) -> Self {
        let mut writer = Self { out, length: 0, mark: START, length_at: 0, charset, error: None };
        writer.text(name);
        if name.is_empty() {
            writer.refuse(EncodeError::NoName);
        }
        writer
    }

    /// Begins a message with the name of another.
    pub(crate) fn named(out: &'o mut [u8], name: &[u8]) -> Self {
        let charset = Charset::Latin1;
        let mut writer = Self { out, length: 0, mark: START, length_at: 0, charset, error: None };
        writer.wire(name);
        writer
    }

    /// Ends the values of the header: the next ones are fields.
    #[inline]
    pub fn data(&mut self) {
        self.empty();
        self.length_at = self.length;
        // Most lengths have two digits.
        self.length += 2;
        self.mark = DATA;
    }

    /// Writes a text. A mark in it, or a character that is not in the character set, is an error of [`finish`](Self::finish).
    #[inline]
    pub fn text(&mut self, text: &str) {
        if text.bytes().all(|byte| byte.is_ascii() && !is_mark(byte)) {
            self.wire(text.as_bytes());
        } else {
            self.chars(text);
        }
    }

    /// Writes a number of this many decimals, 0 to 9, in units of the last one: 1500 with 3 decimals is `1.500`.
    #[inline]
    pub fn number(&mut self, number: i32, places: u8) {
        let length = 1 + number::len(number, places);
        if let Some([mark, place @ ..]) = self.out.get_mut(self.length..self.length + length) {
            *mark = self.mark;
            number::write(number, places, place);
        }
        self.mark = SEPARATOR;
        self.length += length;
    }

    /// Ends the message; returns its length.
    ///
    /// # Errors
    /// See [`EncodeError`]; the contents of the buffer are then undefined.
    #[inline]
    pub fn finish(mut self) -> Result<usize, EncodeError> {
        self.end();
        let Self { length, ref out, .. } = self;
        match (self.error, MAX_LEN, out.len()) {
            (Some(error), ..) => Err(error),
            (_, limit, _) if length > limit => Err(EncodeError::TooLong { length, limit }),
            (.., available) if length > available => {
                Err(EncodeError::BufferTooSmall { needed: length, available })
            }
            _ => Ok(length),
        }
    }

    /// Writes the end; returns the length, whether the buffer has space for it or not.
    #[inline]
    pub(crate) fn end(&mut self) -> usize {
        if self.length_at == 0 {
            self.data();
        }
        if self.mark == DATA {
            self.push(DATA);
        }
        self.set_length();
        self.push(DATA);
        self.push(END);
        self.length
    }

    /// Writes an empty value.
    #[inline]
    pub(crate) fn empty(&mut self) {
        self.push(self.mark);
        self.mark = SEPARATOR;
    }

    /// Writes a text that is known to be in the character set, without a mark.
    #[inline]
    pub(crate) fn wire(&mut self, text: &[u8]) {
        self.empty();
        text.iter().for_each(|byte| self.push(*byte));
    }

    #[inline(never)]
    fn chars(&mut self, text: &str) {
        self.empty();
        for c in text.chars() {
            match self.charset.byte(c) {
                Ok(byte) => self.push(byte),
                Err(error) => {
                    self.refuse(error);
                    self.length += 1;
                }
            }
        }
    }

    /// Records an error of the message, unless there is an earlier one.
    pub(crate) fn refuse(&mut self, error: EncodeError) {
        self.error.get_or_insert(error);
    }

    pub(crate) const fn charset(&self) -> Charset {
        self.charset
    }

    #[inline]
    fn push(&mut self, byte: u8) {
        if let Some(place) = self.out.get_mut(self.length) {
            *place = byte;
        }
        self.length += 1;
    }

    /// Writes the length of the data part to its place, which has two bytes: a length of other digits moves the data part.
    #[inline]
    fn set_length(&mut self) {
        let at = self.length_at;
        // No buffer is longer.
        let data = i32::try_from(self.length - at - "00#".len()).unwrap_or(i32::MAX);
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
