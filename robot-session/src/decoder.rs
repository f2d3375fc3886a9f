//! Bytes in, frames out.

/// Cuts a stream of bytes into frames.
///
/// Call [`push`](Self::push) with the bytes that were read, then [`next_frame`](Self::next_frame) until it returns `None`;
/// push the rest if `push` did not take everything. At the end of the stream, or when the line is silent, call
/// [`finish`](Self::finish) and `next_frame` again.
///
/// - Frames and errors cover the stream without gaps: every byte belongs to exactly one of them, and
///   [`position`](Self::position) returns the end of each. An error covers the bytes up to the possible beginning of the
///   next frame, so a valid frame after an error is not lost.
/// - Chunking of the stream has no effect.
/// - Incomplete input is `None`, never an error; only `finish` makes it one.
/// - After an error, calling again makes progress: a finite input gives finitely many frames and errors.
pub trait Decoder {
    /// A frame, or the message inside it; it may borrow the decoder's buffer.
    type Frame<'a>
    where
        Self: 'a;

    /// The reason that bytes are not a frame: a fault of the peer or of the line.
    type Error: core::error::Error;

    /// Takes bytes; returns how many. If it takes none, its buffer is full and `next_frame` returns a frame or an error.
    #[must_use = "the bytes that were not taken are to be pushed again"]
    fn push(&mut self, bytes: &[u8]) -> usize;

    /// Returns the next frame or error; `None` if more bytes are needed.
    fn next_frame(&mut self) -> Option<Result<Self::Frame<'_>, Self::Error>>;

    /// Marks the end of the stream or datagram, or a silence of the line: an incomplete frame becomes an error.
    fn finish(&mut self);

    /// Returns the stream offset just after the frame or error that `next_frame` returned last.
    fn position(&self) -> u64;

    /// Discards the bytes in the buffer; they count in [`position`](Self::position).
    fn clear(&mut self);
}
