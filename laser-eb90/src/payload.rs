//! Items in, a payload out.

use crate::error::EncodeError;
use crate::frame::{Frame, MAX_PAYLOAD};
use crate::items::Items;
use crate::profile::{ByteOrder, Profile};

/// Writes items into a buffer, one after the other. A failed write leaves the payload as it was.
///
/// ```
/// use laser_eb90::{Payload, Profile};
///
/// let mut buffer = [0; 64];
/// let mut payload = Payload::new(&mut buffer, &Profile::default());
/// payload.i16(&[0x0101])?.f32(&[100.0, -50.5])?;
/// assert_eq!(payload.as_bytes(), [0xF1, 1, 1, 1, 0xF0, 2, 0, 0, 0xC8, 0x42, 0, 0, 0x4A, 0xC2]);
/// # Ok::<(), laser_eb90::EncodeError>(())
/// ```
#[derive(Debug)]
pub struct Payload<'b> {
    buffer: &'b mut [u8],
    len: usize,
    profile: Profile,
}

impl<'b> Payload<'b> {
    /// Creates an empty payload in `buffer`, of which it uses [`MAX_PAYLOAD`] bytes at most.
    pub fn new(buffer: &'b mut [u8], profile: &Profile) -> Self {
        Self::with_len(buffer, 0, profile)
    }

    /// Goes on after the `len` bytes that are there.
    pub(crate) fn with_len(buffer: &'b mut [u8], len: usize, profile: &Profile) -> Self {
        let room = buffer.len().min(MAX_PAYLOAD);
        Self { buffer: buffer.get_mut(..room).unwrap_or_default(), len, profile: *profile }
    }

    /// Adds an item of floats.
    ///
    /// # Errors
    /// A NaN or an infinity, more than 255 values, or a buffer that is too small.
    pub fn f32(&mut self, values: &[f32]) -> Result<&mut Self, EncodeError> {
        if let Some(index) = values.iter().position(|value| !value.is_finite()) {
            return Err(EncodeError::NotFinite { index });
        }
        let order = self.profile.byte_order;
        self.numbers(self.profile.tags.f32, values, |v| match order {
            ByteOrder::Little => v.to_le_bytes(),
            ByteOrder::Big => v.to_be_bytes(),
        })
    }

    /// Adds an item of shorts.
    ///
    /// # Errors
    /// More than 255 values, or a buffer that is too small.
    pub fn i16(&mut self, values: &[i16]) -> Result<&mut Self, EncodeError> {
        let order = self.profile.byte_order;
        self.numbers(self.profile.tags.i16, values, |v| match order {
            ByteOrder::Little => v.to_le_bytes(),
            ByteOrder::Big => v.to_be_bytes(),
        })
    }

    /// Adds an item of bytes.
    ///
    /// # Errors
    /// More than 255 values, or a buffer that is too small.
    pub fn u8(&mut self, values: &[u8]) -> Result<&mut Self, EncodeError> {
        self.numbers(self.profile.tags.u8, values, |v| [v])
    }

    /// Adds an item of characters.
    ///
    /// # Errors
    /// More than 255 values, or a buffer that is too small.
    pub fn char(&mut self, values: &[u8]) -> Result<&mut Self, EncodeError> {
        self.numbers(self.profile.tags.char, values, |v| [v])
    }

    /// Adds a command word, or the error code of a reply: a short of its own, unsigned.
    ///
    /// # Errors
    /// A buffer that is too small.
    pub fn word(&mut self, word: u16) -> Result<&mut Self, EncodeError> {
        self.i16(&[word.cast_signed()])
    }

    /// Adds items as they are in a payload of the same profile.
    ///
    /// # Errors
    /// A buffer that is too small.
    pub(crate) fn items(&mut self, items: Items<'_>) -> Result<&mut Self, EncodeError> {
        let bytes = items.as_bytes();
        let room = self.buffer.get_mut(self.len..).unwrap_or_default();
        let (available, needed) = (room.len(), bytes.len());
        let slot = room.get_mut(..needed).ok_or(EncodeError::BufferTooSmall { needed, available })?;
        slot.copy_from_slice(bytes);
        self.len += needed;
        Ok(self)
    }

    /// Returns the bytes written so far.
    pub fn as_bytes(&self) -> &[u8] {
        self.buffer.get(..self.len).unwrap_or_default()
    }

    /// Returns the frame that contains the payload.
    ///
    /// # Errors
    /// A payload without items.
    pub fn frame(&self) -> Result<Frame<'_>, EncodeError> {
        if self.len == 0 { Err(EncodeError::Empty) } else { Ok(Frame::new(self.as_bytes(), &self.profile)) }
    }

    fn numbers<T: Copy, const N: usize>(
        &mut self,
        tag: u8,
        values: &[T],
        bytes: impl Fn(T) -> [u8; N],
    ) -> Result<&mut Self, EncodeError> {
        let count =
            u8::try_from(values.len()).map_err(|_| EncodeError::TooManyValues { count: values.len() })?;
        let room = self.buffer.get_mut(self.len..).unwrap_or_default();
        let (available, needed) = (room.len(), 2 + N * values.len());
        let Some((head, body)) = room.get_mut(..needed).and_then(|item| item.split_first_chunk_mut()) else {
            return Err(EncodeError::BufferTooSmall { needed, available });
        };
        *head = [tag, count];
        for (slot, value) in body.chunks_exact_mut(N).zip(values) {
            slot.copy_from_slice(&bytes(*value));
        }
        self.len += needed;
        Ok(self)
    }
}
