use super::limit;
use super::wire::room;
use crate::error::EncodeError;

/// The contents of a [`Frame`](crate::Frame): a [`Request`](crate::Request), a [`Reply`](crate::Reply), a
/// [`PduBuf`](crate::PduBuf), or the raw bytes.
pub trait Pdu: sealed::Sealed {
    /// Returns the number of bytes that [`encode`](Self::encode) writes, whether or not the specification allows them.
    fn encoded_len(&self) -> usize;

    /// Writes the PDU to the beginning of `out`, and returns the number of its bytes.
    ///
    /// # Errors
    /// If the specification does not allow the message, or `out` is too small: the contents of `out` are then unspecified.
    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError>;
}

impl Pdu for &[u8] {
    fn encoded_len(&self) -> usize {
        self.len()
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        if !(1..=limit::PDU).contains(&self.len()) {
            return Err(EncodeError::PduLength { found: self.len() });
        }
        room(out, self.len())?.copy_from_slice(self);
        Ok(self.len())
    }
}

pub(super) mod sealed {
    pub trait Sealed {}
    impl Sealed for &[u8] {}
}
