//! The bytes of a stream that a decoder buffers.

/// The bytes of a stream that a [`Decoder`](crate::Decoder) buffers, at most `N`, and their offset in the stream.
#[derive(Debug, Clone)]
pub struct StreamBuffer<const N: usize> {
    bytes: [u8; N],
    start: usize,
    end: usize,
    position: u64,
}

impl<const N: usize> StreamBuffer<N> {
    /// Creates an empty buffer at the beginning of a stream.
    pub const fn new() -> Self {
        Self { bytes: [0; N], start: 0, end: 0, position: 0 }
    }

    /// Takes as many bytes as fit; returns how many.
    #[inline]
    pub fn push(&mut self, bytes: &[u8]) -> usize {
        // A serial line delivers its bytes one by one: copy a single byte without a call.
        if let ([byte], Some(slot)) = (bytes, self.bytes.get_mut(self.end)) {
            *slot = *byte;
            self.end += 1;
            return 1;
        }
        if bytes.len() > N - self.end {
            self.move_to_front();
        }
        let room = self.bytes.get_mut(self.end..).unwrap_or_default();
        let taken = room.len().min(bytes.len());
        if let (Some(room), Some(bytes)) = (room.get_mut(..taken), bytes.get(..taken)) {
            room.copy_from_slice(bytes);
        }
        self.end += taken;
        taken
    }

    /// Returns the bytes in the buffer.
    #[inline]
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(self.start..self.end).unwrap_or_default()
    }

    /// Returns the number of bytes in the buffer.
    #[inline]
    pub const fn len(&self) -> usize {
        self.end - self.start
    }

    /// Returns whether the buffer is empty.
    pub const fn is_empty(&self) -> bool {
        self.start == self.end
    }

    /// Removes the first `length` bytes, and returns them.
    #[inline]
    pub fn take(&mut self, length: usize) -> &[u8] {
        let first = self.start;
        self.start = self.end.min(first + length);
        self.position += (self.start - first) as u64;
        self.bytes.get(first..self.start).unwrap_or_default()
    }

    /// Returns the stream offset of the first byte in the buffer, or of the next byte if the buffer is empty.
    pub const fn position(&self) -> u64 {
        self.position
    }

    /// Discards all bytes.
    pub const fn clear(&mut self) {
        self.position += self.len() as u64;
        self.start = self.end;
    }

    fn move_to_front(&mut self) {
        // Most often there is nothing to move, and no call is needed.
        if self.start < self.end {
            self.bytes.copy_within(self.start..self.end, 0);
        }
        self.end -= self.start;
        self.start = 0;
    }
}

impl<const N: usize> Default for StreamBuffer<N> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_what_has_room_and_gives_it_in_order() {
        let mut buffer = StreamBuffer::<4>::new();
        assert_eq!(
            (buffer.push(b"ab"), buffer.push(b"cde"), buffer.push(b"e"), buffer.push(b"")),
            (2, 2, 0, 0)
        );
        assert_eq!(buffer.bytes(), b"abcd");
        assert_eq!(buffer.take(3), b"abc");
        assert_eq!((buffer.position(), buffer.len()), (3, 1));
        assert_eq!((buffer.push(b"e"), buffer.push(b"fghi")), (1, 2));
        assert_eq!(buffer.take(9), b"defg");
        assert_eq!((buffer.position(), buffer.is_empty()), (7, true));
        assert_eq!((buffer.push(b"h"), buffer.bytes()), (1, &b"h"[..]));
        buffer.clear();
        assert_eq!((buffer.position(), buffer.is_empty(), buffer.push(b"ijkl")), (8, true, 4));
    }
}
