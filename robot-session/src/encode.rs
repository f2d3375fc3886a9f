//! Messages in, bytes out.

/// A message that can be written as bytes.
pub trait Encode {
    /// The reason that a message cannot be encoded: a fault of the caller.
    type Error: core::error::Error;

    /// Returns the number of bytes that [`encode`](Self::encode) writes.
    fn encoded_len(&self) -> usize;

    /// Writes the message; returns the bytes written.
    ///
    /// # Errors
    /// The buffer is too small, and is not changed, or the message has a value that the protocol cannot carry.
    fn encode(&self, out: &mut [u8]) -> Result<usize, Self::Error>;
}
