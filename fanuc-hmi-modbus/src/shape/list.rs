//! Lists of numbers and of bits.

use core::fmt;

use serde::de::{Error as _, SeqAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer};

use super::{ShapeError, truth};
use crate::message::{Bits, limit};

/// The longest list is one of 2000 bits.
pub(super) struct List {
    items: [u16; Self::MAX],
    pub(super) len: usize,
}

impl List {
    pub(super) const MAX: usize = limit::READ_BITS as usize;
    pub(super) const EMPTY: Self = Self { items: [0; Self::MAX], len: 0 };

    /// Adds an item, if it fits.
    pub(super) fn push(&mut self, item: u16) -> Option<()> {
        *self.items.get_mut(self.len)? = item;
        self.len += 1;
        Some(())
    }

    /// Adds the two bytes of each word, the high one first.
    pub(super) fn push_words(&mut self, words: &[u16]) -> Option<()> {
        words.iter().flat_map(|word| word.to_be_bytes()).try_for_each(|byte| self.push(byte.into()))
    }

    pub(super) fn words(&self) -> &[u16] {
        self.items.get(..self.len).unwrap_or_default()
    }

    pub(super) fn to_bits<'b>(&self, out: &'b mut [bool]) -> Result<Bits<'b>, ShapeError> {
        for (bit, word) in out.iter_mut().zip(self.words()) {
            *bit = truth(*word)?;
        }
        Ok(Bits::from(out.get(..self.len).unwrap_or_default()))
    }

    pub(super) fn to_bytes<'b>(&self, out: &'b mut [u8]) -> Result<&'b [u8], ShapeError> {
        let out = out.get_mut(..self.len).ok_or(ShapeError::Range("more data than a PDU holds"))?;
        for (byte, word) in out.iter_mut().zip(self.words()) {
            *byte = u8::try_from(*word).map_err(|_| ShapeError::Range("a byte is 0 to 255"))?;
        }
        Ok(out)
    }
}

impl<'de> Deserialize<'de> for List {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ListVisitor;
        impl<'de> Visitor<'de> for ListVisitor {
            type Value = List;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list of numbers or of bits")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<List, A::Error> {
                let mut list = List::EMPTY;
                while let Some(Number(word)) = seq.next_element()? {
                    list.push(word).ok_or_else(|| A::Error::invalid_length(List::MAX + 1, &self))?;
                }
                Ok(list)
            }
        }
        deserializer.deserialize_seq(ListVisitor)
    }
}

/// A register, a byte, or a bit.
pub(super) struct Number(pub(super) u16);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberVisitor;
        impl Visitor<'_> for NumberVisitor {
            type Value = Number;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("0 to 65535, or true or false")
            }

            fn visit_bool<E: serde::de::Error>(self, bit: bool) -> Result<Number, E> {
                Ok(Number(bit.into()))
            }

            fn visit_u64<E: serde::de::Error>(self, word: u64) -> Result<Number, E> {
                let found = Unexpected::Unsigned(word);
                u16::try_from(word).map(Number).map_err(|_| E::invalid_value(found, &self))
            }
        }
        deserializer.deserialize_any(NumberVisitor)
    }
}
