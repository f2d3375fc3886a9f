use core::fmt;

use crate::value::is_mark;

/// Short text in a job: up to `N` characters of one byte each, up to 255, inside the job itself. A byte is the character of that
/// number (ISO 8859-1); which of them the wire can carry is the dialect's character set.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Text<const N: usize> {
    /// Zeros after the text.
    bytes: [u8; N],
    length: u8,
}

impl<const N: usize> Text<N> {
    /// No character.
    pub const EMPTY: Self = Self { bytes: [0; N], length: 0 };

    /// This text; `None` when it is longer than `N` characters, or holds a mark or a character above U+00FF.
    pub fn new(text: &str) -> Option<Self> {
        let (mut new, mut length) = (Self::EMPTY, 0);
        for c in text.chars() {
            let byte = u8::try_from(c).ok().filter(|byte| !is_mark(*byte))?;
            *new.bytes.get_mut(length)? = byte;
            length += 1;
        }
        new.set_length(length)?;
        Some(new)
    }

    /// The characters.
    pub fn chars(&self) -> impl Iterator<Item = char> + '_ {
        self.as_bytes().iter().map(|byte| char::from(*byte))
    }

    /// The bytes on the wire.
    pub fn as_bytes(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.length)).unwrap_or_default()
    }

    /// Whether there is no character.
    pub const fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// Up to eight bytes from a place, zeros after the last one.
    #[inline(always)]
    pub(super) fn word(&self, at: usize) -> u64 {
        let rest = self.bytes.get(at..).unwrap_or_default();
        u64::from_le_bytes(rest.first_chunk().copied().unwrap_or_else(|| {
            let mut bytes = [0; 8];
            bytes.iter_mut().zip(rest).for_each(|(byte, found)| *byte = *found);
            bytes
        }))
    }

    /// Puts up to eight bytes to a place, zeros after the last one.
    #[inline(always)]
    pub(super) fn put(&mut self, at: usize, word: u64) {
        let Some(rest) = self.bytes.get_mut(at..) else { return };
        match rest.first_chunk_mut() {
            Some(place) => *place = word.to_le_bytes(),
            None => rest.iter_mut().zip(word.to_le_bytes()).for_each(|(place, byte)| *place = byte),
        }
    }

    /// Its length, when all was put; `None` when it is too long.
    #[inline(always)]
    pub(super) fn set_length(&mut self, length: usize) -> Option<()> {
        self.length = u8::try_from(length).ok().filter(|_| length <= N)?;
        Some(())
    }
}

impl<const N: usize> Default for Text<N> {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl<const N: usize> PartialEq<str> for Text<N> {
    fn eq(&self, other: &str) -> bool {
        self.chars().eq(other.chars())
    }
}

impl<const N: usize> PartialEq<&str> for Text<N> {
    fn eq(&self, other: &&str) -> bool {
        *self == **other
    }
}

impl<const N: usize> fmt::Display for Text<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.chars().try_for_each(|c| fmt::Write::write_char(f, c))
    }
}

impl<const N: usize> fmt::Debug for Text<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "\"{self}\"")
    }
}

#[cfg(feature = "defmt")]
impl<const N: usize> defmt::Format for Text<N> {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{}", defmt::Display2Format(self));
    }
}

#[cfg(feature = "serde")]
impl<const N: usize> serde::Serialize for Text<N> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
