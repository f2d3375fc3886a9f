//! Runs of registers and of bits: borrowed from the wire or from the caller, never copied.

use core::fmt;

/// Registers: from the wire, high byte first, or a slice of the caller.
#[derive(Clone, Copy)]
pub struct Words<'a>(WordsIn<'a>);

#[derive(Clone, Copy)]
enum WordsIn<'a> {
    Wire(&'a [[u8; 2]]),
    Memory(&'a [u16]),
}

impl<'a> Words<'a> {
    /// Returns the registers in these bytes, high byte first; an odd last byte is omitted.
    #[inline]
    pub const fn from_wire(bytes: &'a [u8]) -> Self {
        Self(WordsIn::Wire(bytes.as_chunks().0))
    }

    /// Returns the number of registers.
    #[inline]
    pub const fn len(&self) -> usize {
        match self.0 {
            WordsIn::Wire(pairs) => pairs.len(),
            WordsIn::Memory(words) => words.len(),
        }
    }

    /// Returns true if there are no registers.
    #[inline]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the register at `index`, if there is one.
    #[inline]
    pub fn get(&self, index: usize) -> Option<u16> {
        match self.0 {
            WordsIn::Wire(pairs) => pairs.get(index).map(|pair| u16::from_be_bytes(*pair)),
            WordsIn::Memory(words) => words.get(index).copied(),
        }
    }

    /// Returns the registers in sequence.
    #[inline]
    pub fn iter(&self) -> impl ExactSizeIterator<Item = u16> + use<'a> {
        let words = *self;
        (0..words.len()).map(move |index| words.get(index).unwrap_or_default())
    }

    /// Returns the registers as a list.
    #[cfg(feature = "tokio")]
    pub(crate) fn to_vec(self) -> std::vec::Vec<u16> {
        match self.0 {
            WordsIn::Wire(pairs) => pairs.iter().map(|pair| u16::from_be_bytes(*pair)).collect(),
            WordsIn::Memory(words) => words.to_vec(),
        }
    }

    /// Copies as many registers as `out` holds, and returns how many.
    #[inline(always)] // where the words come from is known then
    pub fn copy_to(&self, out: &mut [u16]) -> usize {
        match self.0 {
            WordsIn::Wire(pairs) => copy(pairs, out, u16::from_be_bytes),
            WordsIn::Memory(words) => copy(words, out, |word| word),
        }
        self.len().min(out.len())
    }

    /// Returns the first `N` registers, if there are as many.
    #[inline]
    pub fn first_chunk<const N: usize>(&self) -> Option<[u16; N]> {
        let mut out = [0; N];
        (self.copy_to(&mut out) == N).then_some(out)
    }

    /// Writes the registers, high byte first.
    #[inline]
    pub(crate) fn write(&self, out: &mut [u8]) {
        match self.0 {
            WordsIn::Wire(pairs) => {
                for (to, from) in out.iter_mut().zip(pairs.as_flattened()) {
                    *to = *from;
                }
            }
            WordsIn::Memory(words) => WordsMut::from_wire(out).copy_from(words),
        }
    }
}

impl<'a> From<&'a [u16]> for Words<'a> {
    fn from(words: &'a [u16]) -> Self {
        Self(WordsIn::Memory(words))
    }
}

impl<'a, const N: usize> From<&'a [u16; N]> for Words<'a> {
    fn from(words: &'a [u16; N]) -> Self {
        Self(WordsIn::Memory(words))
    }
}

impl PartialEq for Words<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

impl Eq for Words<'_> {}

impl fmt::Debug for Words<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Words<'_> {
    fn format(&self, f: defmt::Formatter<'_>) {
        format_list(f, self.iter());
    }
}

/// Bits: from the wire, the lowest bit of each byte first, or a slice of the caller.
#[derive(Clone, Copy)]
pub struct Bits<'a>(BitsIn<'a>);

#[derive(Clone, Copy)]
enum BitsIn<'a> {
    Wire { bytes: &'a [u8], len: usize },
    Memory(&'a [bool]),
}

impl<'a> Bits<'a> {
    /// Returns the first `len` bits of these bytes, or as many as there are.
    #[inline]
    pub const fn from_wire(bytes: &'a [u8], len: usize) -> Self {
        let held = bytes.len() * 8;
        Self(BitsIn::Wire { bytes, len: if len < held { len } else { held } })
    }

    /// Returns the number of bits. A reply does not show how many bits of its last byte were requested: all 8 are counted.
    #[inline]
    pub const fn len(&self) -> usize {
        match self.0 {
            BitsIn::Wire { len, .. } => len,
            BitsIn::Memory(bits) => bits.len(),
        }
    }

    /// Returns true if there are no bits.
    #[inline]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the number of bytes of the bits on the wire.
    #[inline]
    pub const fn byte_len(&self) -> usize {
        self.len().div_ceil(8)
    }

    /// Returns the first `len` bits.
    #[must_use]
    pub fn truncated(&self, len: usize) -> Self {
        match self.0 {
            BitsIn::Wire { bytes, len: all } => Self(BitsIn::Wire { bytes, len: len.min(all) }),
            BitsIn::Memory(bits) => Self(BitsIn::Memory(bits.get(..len).unwrap_or(bits))),
        }
    }

    /// Returns the bit at `index`, if there is one.
    #[inline]
    pub fn get(&self, index: usize) -> Option<bool> {
        match self.0 {
            BitsIn::Wire { bytes, len } => {
                let byte = bytes.get(index / 8).filter(|_| index < len)?;
                Some(byte >> (index % 8) & 1 == 1)
            }
            BitsIn::Memory(bits) => bits.get(index).copied(),
        }
    }

    /// Returns the bits in sequence.
    #[inline]
    pub fn iter(&self) -> impl ExactSizeIterator<Item = bool> + use<'a> {
        let bits = *self;
        (0..bits.len()).map(move |index| bits.get(index).unwrap_or_default())
    }

    /// Copies as many bits as `out` holds, and returns how many.
    pub fn copy_to(&self, out: &mut [bool]) -> usize {
        for (to, from) in out.iter_mut().zip(self.iter()) {
            *to = from;
        }
        self.len().min(out.len())
    }

    /// Writes the bits; the rest of the last byte is 0.
    pub(crate) fn write(&self, out: &mut [u8]) {
        match self.0 {
            BitsIn::Wire { bytes, len } => {
                for (to, from) in out.iter_mut().zip(bytes) {
                    *to = *from;
                }
                if let Some(last) = out.get_mut(len / 8) {
                    *last &= !(0xFF << (len % 8));
                }
            }
            BitsIn::Memory(bits) => {
                for (to, eight) in out.iter_mut().zip(bits.chunks(8)) {
                    *to = eight.iter().rev().fold(0, |byte, bit| byte << 1 | u8::from(*bit));
                }
            }
        }
    }
}

impl<'a> From<&'a [bool]> for Bits<'a> {
    fn from(bits: &'a [bool]) -> Self {
        Self(BitsIn::Memory(bits))
    }
}

impl<'a, const N: usize> From<&'a [bool; N]> for Bits<'a> {
    fn from(bits: &'a [bool; N]) -> Self {
        Self(BitsIn::Memory(bits))
    }
}

impl PartialEq for Bits<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

impl Eq for Bits<'_> {}

impl fmt::Debug for Bits<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter().map(u8::from)).finish()
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Bits<'_> {
    fn format(&self, f: defmt::Formatter<'_>) {
        format_list(f, self.iter().map(u16::from));
    }
}

#[cfg(feature = "defmt")]
pub(super) fn format_list(f: defmt::Formatter<'_>, values: impl Iterator<Item = impl defmt::Format>) {
    defmt::write!(f, "[");
    for (at, value) in values.enumerate() {
        if at > 0 {
            defmt::write!(f, ", ");
        }
        defmt::write!(f, "{}", value);
    }
    defmt::write!(f, "]");
}

/// Registers of a reply that is being written, in place.
#[derive(Debug)]
pub struct WordsMut<'a>(&'a mut [[u8; 2]]);

impl<'a> WordsMut<'a> {
    /// Returns the registers that these bytes will contain, high byte first.
    #[inline]
    pub const fn from_wire(bytes: &'a mut [u8]) -> Self {
        Self(bytes.as_chunks_mut().0)
    }

    /// Returns the number of requested registers.
    #[inline]
    pub const fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns true if no register is requested, which is never so in a request.
    #[inline]
    pub const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Sets the register at `index`, counted from the address of the request; an index beyond the last is ignored.
    #[inline]
    pub fn set(&mut self, index: usize, word: u16) {
        if let Some(pair) = self.0.get_mut(index) {
            *pair = word.to_be_bytes();
        }
    }

    /// Sets the first registers from a slice.
    #[inline]
    pub fn copy_from(&mut self, words: &[u16]) {
        copy(words, self.0, u16::to_be_bytes);
    }

    /// Sets each register from its index.
    #[inline]
    pub fn fill_with(&mut self, mut word: impl FnMut(usize) -> u16) {
        for (index, pair) in self.0.iter_mut().enumerate() {
            *pair = word(index).to_be_bytes();
        }
    }
}

/// Bits of a reply that is being written, in place; all are 0 at first.
#[derive(Debug)]
pub struct BitsMut<'a> {
    bytes: &'a mut [u8],
    len: usize,
}

impl<'a> BitsMut<'a> {
    /// Returns the first `len` bits that these bytes will contain.
    pub fn from_wire(bytes: &'a mut [u8], len: usize) -> Self {
        bytes.fill(0);
        Self { bytes, len }
    }

    /// Returns the number of requested bits.
    pub const fn len(&self) -> usize {
        self.len
    }

    /// Returns true if no bit is requested, which is never so in a request.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Sets the bit at `index`, counted from the address of the request; an index beyond the last is ignored.
    pub fn set(&mut self, index: usize, bit: bool) {
        if index < self.len
            && let Some(byte) = self.bytes.get_mut(index / 8)
        {
            let mask = 1 << (index % 8);
            *byte = if bit { *byte | mask } else { *byte & !mask };
        }
    }

    /// Sets each bit from its index.
    pub fn fill_with(&mut self, mut bit: impl FnMut(usize) -> bool) {
        for index in 0..self.len {
            self.set(index, bit(index));
        }
    }
}

/// Copies as many registers as both have. With vectors: eight at once, and the last eight once more instead of one by one.
#[inline(always)] // for few registers there is little of it
fn copy<A: Copy, B>(from: &[A], to: &mut [B], convert: impl Fn(A) -> B + Copy) {
    let len = from.len().min(to.len());
    let (from, to) = (from.get(..len).unwrap_or_default(), to.get_mut(..len).unwrap_or_default());
    if cfg!(target_pointer_width = "64")
        && let (Some(last), Some(to_last)) = (from.last_chunk::<8>(), to.last_chunk_mut())
    {
        *to_last = last.map(convert);
        for (to, from) in to.as_chunks_mut::<8>().0.iter_mut().zip(from.as_chunks::<8>().0) {
            *to = from.map(convert);
        }
        return;
    }
    for (to, from) in to.iter_mut().zip(from) {
        *to = convert(*from);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_stand_lowest_first_in_each_byte() {
        let bits = [true, false, true, true, false, false, false, false, false, true];
        let mut wire = [0xFF; 2];
        Bits::from(&bits).write(&mut wire);
        assert_eq!(wire, [0x0D, 0x02]);
        let view = Bits::from_wire(&wire, 10);
        assert_eq!(view, Bits::from(&bits));
        assert_eq!((view.get(9), view.get(10)), (Some(true), None));
        assert_eq!(Bits::from_wire(&wire, 99).len(), 16);
        assert_eq!(view.truncated(3), Bits::from(&[true, false, true]));
        let mut again = [0xFF; 2];
        Bits::from_wire(&[0xFF, 0xFF], 10).write(&mut again);
        assert_eq!(again, [0xFF, 0x03]);
    }

    #[test]
    fn words_read_the_same_from_the_wire_and_from_memory() {
        let wire = Words::from_wire(&[0x12, 0x34, 0xAB, 0xCD, 0xEE]);
        assert_eq!(wire, Words::from(&[0x1234, 0xABCD]));
        assert_ne!(wire, Words::from(&[0x1234]));
        assert_eq!(wire.first_chunk::<2>(), Some([0x1234, 0xABCD]));
        assert_eq!(wire.first_chunk::<3>(), None);
        let mut out = [0; 3];
        assert_eq!(wire.copy_to(&mut out), 2);
        assert_eq!(out, [0x1234, 0xABCD, 0]);
    }
}
