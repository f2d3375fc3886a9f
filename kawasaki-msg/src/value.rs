//! The values of a message as they stand on the wire: character sets, and a cursor over the values.

use core::fmt;

use crate::error::EncodeError;
use crate::marks::{DATA, END, SEPARATOR, START, is_mark};
use crate::number;

/// The characters that may occur in names and fields. In each set the length counts bytes.
///
/// The source has "ASCII 0–255" in its glossary and shows no letter above 127.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[repr(u8)] // the last character
pub enum Charset {
    /// Bytes 0 to 127; a byte above is an error in both directions.
    #[default]
    Ascii = 0x7F,
    /// ISO 8859-1: every byte is the character of that number.
    Latin1 = 0xFF,
}

impl Charset {
    /// Returns whether a byte from the wire is a character of this set.
    pub const fn has(self, byte: u8) -> bool {
        byte <= self as u8
    }

    /// Returns whether this byte cannot be in the text of a header or a data part: a mark that ends the text, or not a
    /// character of this set.
    #[inline(always)]
    pub(crate) const fn ends_text(self, byte: u8) -> bool {
        (byte == START) | (byte == END) | (byte == DATA) | (byte > self as u8)
    }

    /// Returns whether this byte may end a text: a byte that is not a letter, but may be a digit or a blank.
    #[inline(always)]
    pub(crate) const fn ends_letters(self, byte: u8) -> bool {
        byte <= END || byte > self as u8
    }

    /// Returns the offset of the first byte that [ends a text](Self::ends_text).
    #[inline]
    pub(crate) fn text_end(self, bytes: &[u8]) -> Option<usize> {
        bytes.iter().position(|byte| self.ends_text(*byte))
    }

    /// Returns whether no byte ends the text, without a branch for each byte of a long text.
    #[inline(always)]
    pub(crate) fn is_text(self, bytes: &[u8]) -> bool {
        if bytes.len() < 16 {
            return self.text_end(bytes).is_none();
        }
        !bytes.iter().fold(false, |ends, byte| ends | self.ends_text(*byte))
    }

    /// Returns the byte of a character on the wire.
    pub(crate) fn byte(self, found: char) -> Result<u8, EncodeError> {
        let byte = u8::try_from(found).map_err(|_| EncodeError::Character { found })?;
        if !self.has(byte) {
            return Err(EncodeError::Character { found });
        }
        if is_mark(byte) { Err(EncodeError::Forbidden { found: byte }) } else { Ok(byte) }
    }
}

/// One name, or one field: a byte is the character of that number (ISO 8859-1).
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Value<'a>(pub(crate) &'a [u8]);

impl<'a> Value<'a> {
    /// Returns the bytes on the wire.
    pub const fn as_bytes(&self) -> &'a [u8] {
        self.0
    }

    /// Returns the characters.
    pub fn chars(&self) -> impl Iterator<Item = char> + use<'a> {
        self.0.iter().map(|byte| char::from(*byte))
    }
}

impl PartialEq<str> for Value<'_> {
    fn eq(&self, other: &str) -> bool {
        self.chars().eq(other.chars())
    }
}

impl PartialEq<&str> for Value<'_> {
    fn eq(&self, other: &&str) -> bool {
        *self == **other
    }
}

impl fmt::Display for Value<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.chars().try_for_each(|c| fmt::Write::write_char(f, c))
    }
}

impl fmt::Debug for Value<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "\"{self}\"")
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Value<'_> {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::Display2Format(self).format(f);
    }
}

#[cfg(feature = "serde")]
impl serde::Serialize for Value<'_> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match core::str::from_utf8(self.0) {
            // A text written as a whole costs a tenth of one written character by character.
            Ok(text) if text.is_ascii() => serializer.serialize_str(text),
            _ => serializer.collect_str(self),
        }
    }
}

/// The values of a header or of a data part, in sequence: a cursor over the bytes, which have a mark after each value.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Values<'a>(pub(crate) &'a [u8]);

impl<'a> Values<'a> {
    /// No value.
    pub(crate) const NONE: Self = Self(&[]);

    /// Returns the values in sequence.
    pub fn iter(&self) -> impl Iterator<Item = Value<'a>> + use<'a> {
        let mut rest = *self;
        core::iter::from_fn(move || rest.text())
    }

    /// Returns the number of values.
    pub fn count(&self) -> usize {
        self.0.iter().filter(|byte| is_end(**byte)).count()
    }

    /// Returns the number of bytes, including a mark for each value.
    pub(crate) const fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns whether there are no values.
    #[inline(always)]
    pub(crate) const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns the values before the last `count` ones, and the last `count` ones; `None` if there are fewer.
    #[cold]
    pub(crate) fn split(self, count: usize) -> Option<(Self, Self)> {
        let first = self.count().checked_sub(count)?;
        let mut last = self;
        for _ in 0..first {
            last.text()?;
        }
        let (first, last) = self.0.split_at_checked(self.len() - last.len())?;
        Some((Self(first), Self(last)))
    }

    /// Removes and returns the next value.
    #[inline]
    pub(crate) fn text(&mut self) -> Option<Value<'a>> {
        let end = self.0.iter().position(|byte| is_end(*byte))?;
        let text = self.0.get(..end)?;
        self.0 = self.0.get(end + 1..)?;
        Some(Value(text))
    }

    /// Removes the next value if it is empty; returns whether it was.
    #[inline(always)]
    pub(crate) fn skip_empty(&mut self) -> bool {
        let [first, rest @ ..] = self.0 else { return false };
        let is_empty = is_end(*first);
        if is_empty {
            self.0 = rest;
        }
        is_empty
    }

    /// Removes the next value, and returns it as a number of up to this many decimals, in units of the last one.
    #[inline(always)]
    pub(crate) fn number(&mut self, places: u8) -> Result<i32, number::Fault> {
        if let Some((units, [SEPARATOR | DATA, rest @ ..])) = number::plain(self.0, places) {
            self.0 = rest;
            Ok(units)
        } else {
            self.other_number(places)
        }
    }

    /// Parses a number in another form; an error if the value is not a number.
    #[cold]
    #[inline(never)]
    fn other_number(&mut self, places: u8) -> Result<i32, number::Fault> {
        self.text().map_or(Err(number::Fault::Missing), |value| number::parse(value.0, places))
    }
}

/// Returns whether this mark ends a value.
#[inline(always)]
const fn is_end(byte: u8) -> bool {
    matches!(byte, SEPARATOR | DATA)
}

impl fmt::Debug for Values<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Values<'_> {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "[");
        for (at, value) in self.iter().enumerate() {
            if at > 0 {
                defmt::write!(f, ", ");
            }
            defmt::write!(f, "{:?}", value);
        }
        defmt::write!(f, "]");
    }
}

#[cfg(feature = "serde")]
impl serde::Serialize for Values<'_> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter())
    }
}
