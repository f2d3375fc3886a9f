use core::fmt;

use super::limit;
use super::pdu::{Pdu, sealed};
use super::reply::Reply;
use super::request::Request;
use super::wire::room;
use crate::error::{DecodeError, EncodeError};

/// A PDU of its own: 1 to 253 bytes in an array, where a borrow does not live long enough.
#[derive(Clone, Copy)]
pub struct PduBuf {
    bytes: [u8; limit::PDU],
    len: u8,
}

impl PduBuf {
    /// A buffer without a function code: no frame contains it.
    pub(crate) const EMPTY: Self = Self { bytes: [0; limit::PDU], len: 0 };

    /// Encodes a request or a reply, or copies raw bytes.
    ///
    /// # Errors
    /// If the specification does not allow the message.
    pub fn new(pdu: &impl Pdu) -> Result<Self, EncodeError> {
        let mut bytes = [0; limit::PDU];
        let len = pdu.encode(&mut bytes)?;
        Ok(Self { bytes, len: u8::try_from(len).map_err(|_| EncodeError::PduLength { found: len })? })
    }

    /// Stores this message, unless the specification does not allow it: that is checked before the first byte is written.
    #[inline]
    pub(crate) fn put(&mut self, pdu: &impl Pdu) -> Result<(), EncodeError> {
        let len = pdu.encode(&mut self.bytes)?;
        self.len = u8::try_from(len).map_err(|_| EncodeError::PduLength { found: len })?;
        Ok(())
    }

    /// Stores these bytes, unless they are too many.
    #[inline]
    pub(crate) fn hold(&mut self, pdu: &[u8]) {
        if let (Some(to), Ok(len)) = (self.bytes.get_mut(..pdu.len()), u8::try_from(pdu.len())) {
            to.copy_from_slice(pdu);
            self.len = len;
        }
    }

    /// Returns the bytes: a function code and the bytes after it.
    #[inline]
    pub fn as_bytes(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.len)).unwrap_or_default()
    }

    /// Returns the function code; 0 if the buffer is empty.
    pub(crate) const fn function(&self) -> u8 {
        let [function, ..] = self.bytes;
        function
    }

    /// Returns the request in the buffer.
    ///
    /// # Errors
    /// As [`Request::decode`].
    #[inline]
    pub fn request(&self) -> Result<Request<'_>, DecodeError> {
        Request::decode(self.as_bytes())
    }

    /// Returns the reply in the buffer.
    ///
    /// # Errors
    /// As [`Reply::decode`].
    #[inline]
    pub fn reply(&self) -> Result<Reply<'_>, DecodeError> {
        Reply::decode(self.as_bytes())
    }
}

impl sealed::Sealed for PduBuf {}

impl Pdu for PduBuf {
    fn encoded_len(&self) -> usize {
        self.as_bytes().len()
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        room(out, self.encoded_len())?.copy_from_slice(self.as_bytes());
        Ok(self.encoded_len())
    }
}

impl PartialEq for PduBuf {
    fn eq(&self, other: &Self) -> bool {
        self.as_bytes() == other.as_bytes()
    }
}

impl Eq for PduBuf {}

impl fmt::Debug for PduBuf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "PduBuf({:02X?})", self.as_bytes())
    }
}
