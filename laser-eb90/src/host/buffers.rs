//! The bytes of the host's frames.

use crate::frame::MAX_PAYLOAD;

/// The payload that is being written, and the previous one.
#[derive(Debug, Clone)]
pub(super) struct Buffers {
    buffers: [Buffer; 2],
    /// Whether the second is being written.
    swapped: bool,
}

impl Buffers {
    pub(super) const EMPTY: Self = Self { buffers: [Buffer::EMPTY; 2], swapped: false };

    pub(super) fn next(&self) -> &Buffer {
        let [first, second] = &self.buffers;
        if self.swapped { second } else { first }
    }

    pub(super) fn next_mut(&mut self) -> &mut Buffer {
        let [first, second] = &mut self.buffers;
        if self.swapped { second } else { first }
    }

    pub(super) fn last(&self) -> &Buffer {
        let [first, second] = &self.buffers;
        if self.swapped { first } else { second }
    }

    /// Makes the payload that was being written the last one.
    pub(super) fn swap(&mut self) {
        self.swapped = !self.swapped;
    }
}

/// The bytes of a payload.
#[derive(Debug, Clone)]
pub(super) struct Buffer {
    pub(super) bytes: [u8; MAX_PAYLOAD],
    pub(super) len: u16,
}

const _: () = assert!(MAX_PAYLOAD <= u16::MAX as usize);

impl Buffer {
    pub(super) const EMPTY: Self = Self { bytes: [0; MAX_PAYLOAD], len: 0 };

    pub(super) fn as_bytes(&self) -> &[u8] {
        self.bytes.get(..self.len.into()).unwrap_or_default()
    }

    pub(super) fn set_len(&mut self, len: usize) {
        self.len = u16::try_from(len).unwrap_or_default();
    }

    pub(super) fn copy(&mut self, bytes: &[u8]) {
        if let Some(slot) = self.bytes.get_mut(..bytes.len()) {
            slot.copy_from_slice(bytes);
            self.set_len(bytes.len());
        }
    }
}
