//! The bytes of a stream that wait to be read, and the ends of its input.

use core::ops::Range;

/// At most [`CAPACITY`] bytes.
#[derive(Debug, Clone)]
pub(crate) struct Stream {
    buffer: [u8; CAPACITY],
    start: usize,
    end: usize,
    /// Bytes of the stream before the buffer.
    passed: u64,
    /// The index of an end: the bytes before it will not continue.
    finished_at: Option<usize>,
    /// The index of a later end, reported before the first was drained.
    finished_later: Option<usize>,
}

pub(crate) const CAPACITY: usize = 1024;

impl Stream {
    pub(crate) const fn new() -> Self {
        Self { buffer: [0; CAPACITY], start: 0, end: 0, passed: 0, finished_at: None, finished_later: None }
    }

    /// Returns whether this many bytes fit only after the space of the taken bytes was freed.
    #[inline]
    pub(crate) const fn is_tight(&self, length: usize) -> bool {
        length > CAPACITY - self.end
    }

    /// Frees the space of the taken bytes; returns the number of bytes by which everything has moved.
    pub(crate) fn compact(&mut self) -> usize {
        let gone = self.start;
        self.buffer.copy_within(gone..self.end, 0);
        self.passed += gone as u64;
        self.start = 0;
        self.end -= gone;
        for at in [&mut self.finished_at, &mut self.finished_later].into_iter().flatten() {
            *at = at.saturating_sub(gone);
        }
        gone
    }

    /// Takes as many bytes as fit; returns how many.
    #[inline(always)] // into the one place that often has bytes
    pub(crate) fn push(&mut self, bytes: &[u8]) -> usize {
        // A port that delivers single bytes: copy one without a call.
        if let ([byte], Some(room)) = (bytes, self.buffer.get_mut(self.end)) {
            *room = *byte;
            self.end += 1;
            return 1;
        }
        let room = self.buffer.get_mut(self.end..).unwrap_or_default();
        let taken = room.len().min(bytes.len());
        if let (Some(to), Some(from)) = (room.get_mut(..taken), bytes.get(..taken)) {
            to.copy_from_slice(from);
        }
        self.end += taken;
        taken
    }

    /// Returns the index of the first waiting byte.
    #[inline]
    pub(crate) const fn start(&self) -> usize {
        self.start
    }

    /// Returns the index of the end of all bytes that have come.
    #[inline]
    pub(crate) const fn end(&self) -> usize {
        self.end
    }

    /// Returns the index at which the waiting bytes, or the input, have ended.
    #[inline]
    pub(crate) fn limit(&self) -> usize {
        self.finished_at.unwrap_or(self.end)
    }

    /// Returns whether the input has ended at [`limit`](Self::limit).
    #[inline]
    pub(crate) const fn has_ended(&self) -> bool {
        self.finished_at.is_some()
    }

    #[inline]
    pub(crate) fn get(&self, range: Range<usize>) -> Option<&[u8]> {
        self.buffer.get(range)
    }

    /// Returns the waiting bytes up to [`limit`](Self::limit).
    #[inline]
    pub(crate) fn held(&self) -> &[u8] {
        self.buffer.get(self.start..self.limit()).unwrap_or_default()
    }

    /// Takes this many of the waiting bytes; returns their range.
    #[inline]
    pub(crate) fn take(&mut self, length: usize) -> Range<usize> {
        let start = self.start;
        self.start += length;
        start..self.start
    }

    /// Records the end of the input.
    pub(crate) fn finish(&mut self) {
        let end = Some(self.end);
        if self.finished_at.is_none() { self.finished_at = end } else { self.finished_later = end }
    }

    /// Called when the waiting bytes up to the end of the input were taken.
    pub(crate) fn pass_end(&mut self) {
        self.finished_at = self.finished_later.take();
    }

    /// Returns the bytes that were taken last to the waiting bytes.
    pub(crate) const fn put_back(&mut self, range: &Range<usize>) {
        self.start = range.start;
    }

    pub(crate) const fn pending(&self) -> usize {
        self.end - self.start
    }

    pub(crate) const fn position(&self) -> u64 {
        self.position_of(self.start)
    }

    /// Returns the stream offset of an index in the buffer.
    pub(crate) const fn position_of(&self, index: usize) -> u64 {
        self.passed + index as u64
    }

    /// Discards the waiting bytes.
    pub(crate) const fn clear(&mut self) {
        self.passed += self.end as u64;
        (self.start, self.end) = (0, 0);
        (self.finished_at, self.finished_later) = (None, None);
    }
}
