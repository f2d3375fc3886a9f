//! The frames that wait to be sent.

use crate::frame::Frame;
use crate::message::{Exception, function};

/// At most `N` frames, oldest first. The machine has their number.
#[derive(Debug, Clone)]
pub(super) struct Replies<const N: usize> {
    frames: [Reply; N],
    first: usize,
    next: usize,
}

/// A frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reply {
    pub(super) bytes: [u8; Frame::MAX_LEN],
    pub(super) length: usize,
}

impl Reply {
    pub(super) const EMPTY: Self = Self { bytes: [0; Frame::MAX_LEN], length: 0 };

    /// Returns the exception in the frame.
    #[inline]
    pub(super) fn exception(&self, tcp: bool) -> Option<Exception> {
        let (before, length) = if tcp { (7, 9) } else { (1, 5) };
        match self.bytes.get(before..)? {
            [code, exception, ..] if self.length == length && *code >= function::EXCEPTION => {
                Some((*exception).into())
            }
            _ => None,
        }
    }
}

impl<const N: usize> Replies<N> {
    pub(super) const EMPTY: Self = Self { frames: [Reply::EMPTY; N], first: 0, next: 0 };

    /// Returns the entry for one more frame.
    #[inline]
    pub(super) fn push(&mut self) -> Option<&mut Reply> {
        let reply = self.frames.get_mut(self.next)?;
        self.next = (self.next + 1) % N;
        Some(reply)
    }

    /// Writes the oldest frame to `out`; returns its length.
    #[inline]
    pub(super) fn pop(&mut self, out: &mut [u8]) -> Option<usize> {
        let reply = self.frames.get(self.first)?;
        let length = reply.length;
        out.get_mut(..length)?.copy_from_slice(reply.bytes.get(..length)?);
        self.first = (self.first + 1) % N;
        Some(length)
    }

    pub(super) fn clear(&mut self) {
        (self.first, self.next) = (0, 0);
    }
}
