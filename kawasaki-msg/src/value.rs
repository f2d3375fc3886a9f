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
    #[inline]
    pub(crate) const fn ends_text(self, byte: u8) -> bool {
        matches!(byte, START | END | DATA) || !self.has(byte)
    }

    /// Where text ends: at the first byte that [ends it](Self::ends_text).
    #[inline]
    pub(crate) fn text_end(self, bytes: &[u8]) -> Option<usize> {
        bytes.iter().position(|byte| self.ends_text(*byte))
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
    /// Text to send.
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
            Value::Text(text) => number::parse(text.as_bytes(), 0).ok(),
            Value::Wire(bytes) => number::parse(bytes, 0).ok(),
        }
    }

    /// The number of up to this many decimals in this value, in units of the last one.
    pub(crate) fn decimal(&self, places: u8) -> Result<i32, number::Fault> {
        match *self {
            Value::Number(n) => number::parse(number::Text::new(n).as_bytes(), places),
            Value::Text(text) => number::parse(text.as_bytes(), places),
            Value::Wire(bytes) => number::parse(bytes, places),
        }
    }

    /// Whether there is no character.
    pub fn is_empty(&self) -> bool {
        matches!(self, Value::Text("") | Value::Wire([]))
    }

    /// The characters.
    pub fn chars(&self) -> impl Iterator<Item = char> + use<'a> {
        let (number, text, wire) = match *self {
            Value::Number(n) => (Some(number::Text::new(n)), "", &[][..]),
            Value::Text(text) => (None, text, &[][..]),
            Value::Wire(bytes) => (None, "", bytes),
        };
        let digits = number.into_iter().flatten().map(char::from);
        digits.chain(text.chars()).chain(wire.iter().map(|b| char::from(*b)))
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
        match self {
            Value::Wire(bytes) => bytes.iter().map(|byte| char::from(*byte)).eq(other.chars()),
            value => value.chars().eq(other.chars()),
        }
    }
}

impl PartialEq<&str> for Value<'_> {
    fn eq(&self, other: &&str) -> bool {
        *self == **other
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
        Left(*self)
    }

    /// Those before the last `count` ones, and these; `None` where there are fewer.
    pub(crate) fn split(self, count: usize) -> Option<(Self, Self)> {
        let wire = match self {
            Values::Wire(wire) if count > 0 => wire,
            Values::Wire(_) => return Some((self, Self::NONE)),
            Values::List(list) => {
                let (before, last) = list.split_at(list.len().checked_sub(count)?);
                return Some((Values::List(before), Values::List(last)));
            }
        };
        let mut before = Some(wire);
        for _ in 0..count {
            let rest = before?;
            let mark = rest.iter().rposition(|byte| *byte == SEPARATOR);
            before = mark.and_then(|mark| rest.get(..mark));
        }
        let last = wire.get(before.map_or(0, |before| before.len() + 1)..)?;
        Some((before.map_or(Self::NONE, Values::Wire), Values::Wire(last)))
    }

    /// How many values there are.
    pub fn count(&self) -> usize {
        match *self {
            Values::Wire(bytes) => 1 + bytes.iter().filter(|byte| **byte == SEPARATOR).count(),
            Values::List(list) => list.len(),
        }
    }

    /// The value at a place, counted from 0.
    pub fn get(&self, index: usize) -> Option<Value<'a>> {
        self.iter().nth(index)
    }
}

/// The values that are left.
#[derive(Clone, Copy)]
pub(crate) struct Left<'a>(pub(crate) Values<'a>);

impl Left<'_> {
    /// The next value as a number of up to this many decimals: it ends where its digits do.
    #[inline(always)]
    pub(crate) fn decimal(&mut self, places: u8) -> Option<Result<i32, number::Fault>> {
        if let Values::Wire(wire) = self.0 {
            let (number, rest) = number::read(wire, places);
            let left = match rest {
                [] => Some(Values::NONE),
                [SEPARATOR, rest @ ..] => Some(Values::Wire(rest)),
                _ => None,
            };
            if let Some(left) = left {
                self.0 = left;
                return Some(number);
            }
        }
        self.next().map(|value| value.decimal(places))
    }
}

impl<'a> Iterator for Left<'a> {
    type Item = Value<'a>;

    #[inline]
    fn next(&mut self) -> Option<Value<'a>> {
        let wire = match self.0 {
            Values::Wire(wire) => wire,
            Values::List([first, rest @ ..]) => {
                self.0 = Values::List(rest);
                return Some(*first);
            }
            Values::List([]) => return None,
        };
        let end = wire.iter().position(|byte| *byte == SEPARATOR);
        self.0 = end.and_then(|end| wire.get(end + 1..)).map_or(Values::NONE, Values::Wire);
        wire.get(..end.unwrap_or(wire.len())).map(Value::Wire)
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
