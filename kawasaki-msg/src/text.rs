use core::fmt;

use crate::marks::is_mark;

/// Short text in a job: up to `N` characters of one byte each, up to 255, inside the job itself. A byte is the character of that
/// number (ISO 8859-1); which of them the wire can carry is the dialect's character set.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Text<const N: usize> {
    /// Zeros after the text.
    bytes: [u8; N],
    length: u8,
}

/// The beginning of a name, as long as a name can be in AS: 15 characters (thesis, section 5.1).
pub type Name = Text<15>;

impl<const N: usize> Text<N> {
    /// No character.
    pub const EMPTY: Self = Self { bytes: [0; N], length: 0 };

    /// Returns the text; `None` if it is longer than `N` characters, or contains a mark or a character above U+00FF.
    pub fn new(text: &str) -> Option<Self> {
        let mut new = Self::EMPTY;
        for c in text.chars() {
            *new.bytes.get_mut(usize::from(new.length))? =
                u8::try_from(c).ok().filter(|byte| !is_mark(*byte))?;
            new.length = new.length.checked_add(1)?;
        }
        Some(new)
    }

    /// Returns the beginning of a text, with a `?` in place of each character that [`new`](Self::new) rejects.
    pub fn of(text: &str) -> Self {
        Self::beginning(text.chars())
    }

    pub(crate) fn beginning(text: impl Iterator<Item = char>) -> Self {
        let mut new = Self::EMPTY;
        for (byte, c) in new.bytes.iter_mut().zip(text).take(u8::MAX.into()) {
            *byte = u8::try_from(c).ok().filter(|byte| !is_mark(*byte)).unwrap_or(b'?');
            new.length += 1;
        }
        new
    }

    /// Returns the characters.
    pub fn chars(&self) -> impl Iterator<Item = char> + '_ {
        self.as_bytes().iter().map(|byte| char::from(*byte))
    }

    /// Returns the bytes on the wire.
    pub fn as_bytes(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.length)).unwrap_or_default()
    }

    /// Returns whether the text is empty.
    pub const fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// Returns the text of these bytes; `None` if they are more than `N` or 255.
    #[inline]
    pub(crate) fn from_wire(bytes: &[u8]) -> Option<Self> {
        let mut text = Self { bytes: [0; N], length: u8::try_from(bytes.len()).ok()? };
        text.bytes.get_mut(..bytes.len())?.copy_from_slice(bytes);
        Some(text)
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
