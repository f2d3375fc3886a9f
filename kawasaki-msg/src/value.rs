//! The values between two `$`: text on the wire, numbers and text in the program.

use core::fmt;

use crate::error::EncodeError;
use crate::number;

/// The mark that begins a message.
pub const START: u8 = b'<';
/// The mark that ends a message.
pub const END: u8 = b'>';
/// The mark between two values.
pub const SEPARATOR: u8 = b'$';
/// The mark before and after the data part.
pub const DATA: u8 = b'#';

/// Whether no name and no field may hold this byte.
pub(crate) const fn is_mark(byte: u8) -> bool {
    matches!(byte, START | END | SEPARATOR | DATA)
}

/// The characters that may occur in names and fields. The length counts bytes in either.
///
/// The source says "ASCII 0–255" in its glossary and shows no letter above 127.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Charset {
    /// Bytes 0 to 127; a byte above is an error in both directions.
    #[default]
    Ascii,
    /// ISO 8859-1: every byte is the character of that number.
    Latin1,
}

impl Charset {
    /// Whether a byte from the wire is a character of this set.
    pub const fn has(self, byte: u8) -> bool {
        matches!(self, Charset::Latin1) || byte.is_ascii()
    }

    /// Whether this byte cannot be in the text of a header or a data part: a mark that ends one, or no character.
    pub(crate) const fn ends_text(self, byte: u8) -> bool {
        matches!(byte, START | END | DATA) || !self.has(byte)
    }

    /// Where text ends that begins at a place: at the first byte that [ends it](Self::ends_text).
    #[inline(always)]
    pub(crate) fn text_end(self, bytes: &[u8], from: usize) -> Option<usize> {
        let (words, tail) = bytes.get(from..)?.as_chunks();
        for (at, word) in words.iter().enumerate() {
            let ends = self.text_ends(u64::from_le_bytes(*word));
            if ends != 0 {
                return Some(from + 8 * at + ends.trailing_zeros() as usize / 8);
            }
        }
        let end = tail.iter().position(|byte| self.ends_text(*byte))?;
        Some(from + 8 * words.len() + end)
    }

    /// Whether no byte [ends text](Self::ends_text): eight at a time, the last ones once more perhaps.
    #[inline(never)] // its constants are in registers here
    pub(crate) fn is_text(self, bytes: &[u8]) -> bool {
        let Some(last) = bytes.last_chunk() else { return !bytes.iter().any(|byte| self.ends_text(*byte)) };
        let mut ends = self.text_ends(u64::from_le_bytes(*last));
        for word in bytes.as_chunks().0 {
            ends |= self.text_ends(u64::from_le_bytes(*word));
        }
        ends == 0
    }

    /// The highest bit of the first byte that ends text is the lowest bit that is set.
    #[inline(always)]
    fn text_ends(self, word: u64) -> u64 {
        const ONES: u64 = u64::from_le_bytes([1; 8]);
        // `<` and `>` differ in one bit.
        let ends = (word & !(ONES * u64::from(START ^ END))) ^ (ONES * u64::from(START & END));
        let data = word ^ (ONES * u64::from(DATA));
        // Of a byte that is 0, and of no byte below the first such one, the highest bit comes up by a borrow.
        let zeros = (ends.wrapping_sub(ONES) & !ends) | (data.wrapping_sub(ONES) & !data);
        let others = if matches!(self, Charset::Ascii) { word } else { 0 };
        (zeros | others) & (ONES << 7)
    }

    /// The byte that a character is on the wire.
    pub(crate) fn byte(self, found: char) -> Result<u8, EncodeError> {
        let byte = u8::try_from(found).map_err(|_| EncodeError::Character { found })?;
        if !self.has(byte) {
            return Err(EncodeError::Character { found });
        }
        if is_mark(byte) { Err(EncodeError::Forbidden { found: byte }) } else { Ok(byte) }
    }
}

/// One name or one field. Two values are equal when their characters are.
#[derive(Clone, Copy)]
pub enum Value<'a> {
    /// A whole number, written without blanks.
    Number(i32),
    /// Text of ours.
    Text(&'a str),
    /// Text as it stood on the wire, a byte a character.
    Wire(&'a [u8]),
}

impl<'a> Value<'a> {
    /// The whole number in this value, blanks around it left out: AS programs print them. `None` when it is anything else
    /// or does not fit.
    pub fn number(&self) -> Option<i32> {
        match *self {
            Value::Number(n) => Some(n),
            Value::Text(text) => number::parse(text.as_bytes()),
            Value::Wire(bytes) => number::parse(bytes),
        }
    }

    /// Whether there is no character.
    pub fn is_empty(&self) -> bool {
        self.chars().next().is_none()
    }

    /// The characters.
    pub fn chars(&self) -> impl Iterator<Item = char> + use<'a> {
        let (number, text, wire) = match *self {
            Value::Number(n) => (Some(number::Digits::new(n)), "", &[][..]),
            Value::Text(text) => (None, text, &[][..]),
            Value::Wire(bytes) => (None, "", bytes),
        };
        let digits = number.into_iter().flatten().map(char::from);
        digits.chain(text.chars()).chain(wire.iter().map(|b| char::from(*b)))
    }

    /// How many bytes it is on the wire, if it can be written at all.
    pub(crate) fn wire_len(&self) -> usize {
        match *self {
            Value::Number(n) => number::len(n),
            Value::Text(text) => text.chars().count(),
            Value::Wire(bytes) => bytes.len(),
        }
    }
}

impl PartialEq for Value<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.chars().eq(other.chars())
    }
}

impl Eq for Value<'_> {}

impl PartialEq<str> for Value<'_> {
    fn eq(&self, other: &str) -> bool {
        *self == Value::Text(other)
    }
}

impl PartialEq<&str> for Value<'_> {
    fn eq(&self, other: &&str) -> bool {
        *self == Value::Text(other)
    }
}

impl From<i32> for Value<'_> {
    fn from(number: i32) -> Self {
        Value::Number(number)
    }
}

impl<'a> From<&'a str> for Value<'a> {
    fn from(text: &'a str) -> Self {
        Value::Text(text)
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

/// The values of a header or of a data part, in order: as they stood on the wire, or as the program lists them.
#[derive(Clone, Copy)]
pub enum Values<'a> {
    /// Joined by `$`, as they stood on the wire: no byte is one empty value.
    Wire(&'a [u8]),
    /// As the program lists them.
    List(&'a [Value<'a>]),
}

impl<'a> Values<'a> {
    /// No value at all.
    pub const NONE: Self = Values::List(&[]);

    /// The values in order.
    pub fn iter(&self) -> impl Iterator<Item = Value<'a>> + use<'a> {
        let (wire, list) = match *self {
            Values::Wire(bytes) => (Some(bytes), &[][..]),
            Values::List(list) => (None, list),
        };
        let wire = wire.into_iter().flat_map(|bytes| bytes.split(|b| *b == SEPARATOR)).map(Value::Wire);
        wire.chain(list.iter().copied())
    }

    /// How many bytes they are on the wire, with the separators between them.
    pub(crate) fn wire_len(&self) -> usize {
        match *self {
            Values::Wire(bytes) => bytes.len(),
            Values::List(list) => list.iter().map(|v| v.wire_len() + 1).sum::<usize>().saturating_sub(1),
        }
    }

    /// How many values there are.
    pub fn count(&self) -> usize {
        self.iter().count()
    }

    /// The value at a place, counted from 0.
    pub fn get(&self, index: usize) -> Option<Value<'a>> {
        self.iter().nth(index)
    }
}

impl PartialEq for Values<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

impl Eq for Values<'_> {}

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
impl serde::Serialize for Value<'_> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match *self {
            Value::Text(text) => serializer.serialize_str(text),
            Value::Wire(bytes) => match core::str::from_utf8(bytes) {
                // A whole text costs a tenth of one that goes character by character.
                Ok(text) if text.is_ascii() => serializer.serialize_str(text),
                _ => serializer.collect_str(self),
            },
            Value::Number(_) => serializer.collect_str(self),
        }
    }
}

#[cfg(feature = "serde")]
impl serde::Serialize for Values<'_> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match *self {
            Values::Wire(bytes) => {
                serializer.collect_seq(bytes.split(|byte| *byte == SEPARATOR).map(Value::Wire))
            }
            Values::List(list) => serializer.collect_seq(list),
        }
    }
}
