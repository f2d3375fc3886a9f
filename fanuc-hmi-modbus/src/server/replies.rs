//! The frames that wait to be sent.

use crate::frame::Frame;
use crate::message::{Exception, function};

/// At most `N` frames, oldest first.
#[derive(Debug, Clone)]
pub(super) struct Replies<const N: usize> {
    frames: [Reply; N],
    first: usize,
    count: usize,
}

#[derive(Debug, Clone, Copy)]
struct Reply {
    bytes: [u8; Frame::MAX_LEN],
    length: usize,
}

impl<const N: usize> Replies<N> {
    pub(super) const EMPTY: Self =
        Self { frames: [Reply { bytes: [0; Frame::MAX_LEN], length: 0 }; N], first: 0, count: 0 };

    /// Keeps the frame that `write` makes; gives the exception in it.
    #[inline]
    pub(super) fn push(
        &mut self,
        tcp: bool,
        write: impl FnOnce(&mut [u8]) -> Option<usize>,
    ) -> Option<Exception> {
        let reply = self.frames.get_mut((self.first + self.count) % N)?;
        reply.length = write(&mut reply.bytes)?;
        self.count += 1;
        let bytes = reply.bytes.get(..reply.length)?;
        exception(bytes, tcp)
    }

    /// Writes the oldest frame to `out`; gives its length.
    #[inline]
    pub(super) fn pop(&mut self, out: &mut [u8]) -> Option<usize> {
        let reply = self.frames.get(self.first)?;
        let length = reply.length;
        out.get_mut(..length)?.copy_from_slice(reply.bytes.get(..length)?);
        self.first = (self.first + 1) % N;
        self.count = self.count.checked_sub(1)?;
        Some(length)
    }

    pub(super) fn clear(&mut self) {
        (self.first, self.count) = (0, 0);
    }
}

/// The exception in a frame.
#[inline]
pub(super) fn exception(reply: &[u8], tcp: bool) -> Option<Exception> {
    let pdu = if tcp { reply.get(7..)? } else { reply.get(1..reply.len().checked_sub(2)?)? };
    match pdu {
        [code, exception] if *code >= function::EXCEPTION => Some((*exception).into()),
        _ => None,
    }
}
