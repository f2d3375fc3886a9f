//! The items of a frame: each a tag, a count and that many values of one type.

use crate::error::DecodeError;
use crate::profile::{ByteOrder, Profile, Tags};

/// One item of a payload: values of one type.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Item<'a> {
    /// `float` values, tag F0h by default: IEEE 754, in the unit of the instruction.
    F32(Values<'a, f32>),
    /// `short` values, tag F1h by default.
    I16(Values<'a, i16>),
    /// `byte` values, tag F2h by default.
    U8(&'a [u8]),
    /// `char` values, tag F3h by default: bytes of an unstated character set. In JSON each is the character U+0000 to
    /// U+00FF of the same number.
    Char(&'a [u8]),
}

/// The items of a payload, in the order of the wire, read one by one.
///
/// A payload may have the right checksum and still be wrong: the first corrupt item is an error, and the last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Items<'a> {
    rest: &'a [u8],
    /// The length of the whole payload, for the offset in an error.
    whole: usize,
    tags: Tags,
    order: ByteOrder,
}

impl<'a> Items<'a> {
    /// Returns the items of an unstuffed payload.
    pub fn new(payload: &'a [u8], profile: &Profile) -> Self {
        Self { rest: payload, whole: payload.len(), tags: profile.tags, order: profile.byte_order }
    }

    /// Returns the items that remain, in the form of the payload.
    pub fn as_bytes(&self) -> &'a [u8] {
        self.rest
    }

    /// Returns whether no items remain.
    pub fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    /// Reads over all items that are left.
    ///
    /// # Errors
    /// A byte that is not a tag, or an item that is longer than the payload.
    pub fn check(mut self) -> Result<(), DecodeError> {
        self.try_for_each(|item| item.map(drop))
    }

    /// Returns the items before `rest`, which is the end of the same items.
    pub(crate) fn before(self, rest: Items<'a>) -> Self {
        let length = self.rest.len().saturating_sub(rest.rest.len());
        Self {
            rest: self.rest.get(..length).unwrap_or_default(),
            whole: self.whole - rest.rest.len(),
            ..self
        }
    }

    /// Cuts an item off: tag, count and `count` values of `size` bytes. The error is the length that it needs.
    #[inline]
    fn values(&mut self, size: usize, count: u8) -> Result<&'a [u8], usize> {
        let needed = 2 + size * usize::from(count);
        let (item, rest) = self.rest.split_at_checked(needed).ok_or(needed)?;
        self.rest = rest;
        Ok(item.get(2..).unwrap_or_default())
    }

    /// Returns the error of a tag without a count.
    #[cold]
    fn no_count(&mut self, tag: u8) -> DecodeError {
        if is_tag(tag, &self.tags) { self.cut_short(2) } else { self.no_tag(tag) }
    }

    #[cold]
    fn cut_short(&mut self, needed: usize) -> DecodeError {
        let found = core::mem::take(&mut self.rest).len();
        DecodeError::Item { offset: self.whole - found, needed, found }
    }

    #[cold]
    fn no_tag(&mut self, found: u8) -> DecodeError {
        let left = core::mem::take(&mut self.rest).len();
        DecodeError::Tag { offset: self.whole - left, found }
    }
}

impl<'a> Iterator for Items<'a> {
    type Item = Result<Item<'a>, DecodeError>;

    #[inline(always)]
    fn next(&mut self) -> Option<Result<Item<'a>, DecodeError>> {
        let order = self.order;
        let (tag, count) = match *self.rest {
            [tag, count, ..] => (tag, count),
            [tag] => return Some(Err(self.no_count(tag))),
            [] => return None,
        };
        let item = match tag {
            t if t == self.tags.f32 => self.values(4, count).map(|v| Item::F32(Values::new(v, order))),
            t if t == self.tags.i16 => self.values(2, count).map(|v| Item::I16(Values::new(v, order))),
            t if t == self.tags.u8 => self.values(1, count).map(Item::U8),
            t if t == self.tags.char => self.values(1, count).map(Item::Char),
            found => return Some(Err(self.no_tag(found))),
        };
        Some(item.map_err(|needed| self.cut_short(needed)))
    }
}

/// Numbers of one type in the form of the payload, decoded on access.
#[derive(Clone, Copy)]
pub struct Values<'a, T> {
    bytes: &'a [u8],
    order: ByteOrder,
    number: core::marker::PhantomData<T>,
}

impl<'a, T: Number> Values<'a, T> {
    fn new(bytes: &'a [u8], order: ByteOrder) -> Self {
        Self { bytes, order, number: core::marker::PhantomData }
    }

    /// Returns the number of values: 0 to 255.
    pub fn len(&self) -> usize {
        self.bytes.len() / size_of::<T>()
    }

    /// Returns whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Returns the numbers in sequence.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = T> + use<'a, T> {
        let order = self.order;
        self.bytes.chunks_exact(size_of::<T>()).map(move |bytes| T::read(bytes, order))
    }

    /// Returns all numbers, if there are exactly `N`.
    #[inline]
    pub fn array<const N: usize>(&self) -> Option<[T; N]> {
        T::read_array(self.bytes, self.order)
    }
}

impl<T: Number> PartialEq for Values<'_, T> {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

impl<T: Number> core::fmt::Debug for Values<'_, T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

/// The number types that travel as more than one byte: `f32` and `i16`.
pub trait Number: Copy + Default + PartialEq + core::fmt::Debug + private::Sealed {
    #[doc(hidden)]
    fn read(bytes: &[u8], order: ByteOrder) -> Self;

    #[doc(hidden)]
    fn read_array<const N: usize>(bytes: &[u8], order: ByteOrder) -> Option<[Self; N]>;
}

macro_rules! number {
    ($number:ty) => {
        impl Number for $number {
            #[inline]
            fn read(bytes: &[u8], order: ByteOrder) -> Self {
                let bytes = bytes.first_chunk().copied().unwrap_or_default();
                match order {
                    ByteOrder::Little => Self::from_le_bytes(bytes),
                    ByteOrder::Big => Self::from_be_bytes(bytes),
                }
            }

            #[inline]
            fn read_array<const N: usize>(bytes: &[u8], order: ByteOrder) -> Option<[Self; N]> {
                let (numbers, _) = bytes.as_chunks();
                let numbers: &[_; N] = numbers.try_into().ok()?;
                // One branch for all of them, so that they are copied as a block.
                Some(match order {
                    ByteOrder::Little => numbers.map(Self::from_le_bytes),
                    ByteOrder::Big => read_big(numbers, Self::from_be_bytes),
                })
            }
        }

        impl private::Sealed for $number {}
    };
}

number!(f32);
number!(i16);

/// Reads numbers of the other byte order; out of line, so that the usual order costs one branch that is not taken, for one
/// number as for many.
#[cold]
fn read_big<B: Copy, T, const N: usize>(numbers: &[B; N], read: impl FnMut(B) -> T) -> [T; N] {
    numbers.map(read)
}

mod private {
    pub trait Sealed {}
}

/// Returns whether a payload can begin with this byte: which distinguishes a head from a false one. Nearly all payloads
/// begin with a command word.
#[inline]
pub(crate) fn is_tag(byte: u8, tags: &Tags) -> bool {
    byte == tags.i16 || is_tag_of_values(byte, tags)
}

#[cold]
fn is_tag_of_values(byte: u8, tags: &Tags) -> bool {
    [tags.f32, tags.u8, tags.char].contains(&byte)
}
