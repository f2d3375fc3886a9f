//! The common trait of both sides' messages.

use robot_session::Encode;

use crate::error::{DecodeError, EncodeError};
use crate::frame::{Frame, plain_data, plain_len};
use crate::framing::Framing;

/// A message of one side of the link. Implemented by [`RobotMessage`](crate::RobotMessage) and
/// [`HostMessage`](crate::HostMessage), and closed.
pub trait Message: Copy + core::fmt::Debug + PartialEq + Sealed {
    /// The most data bytes that a message of this side has.
    const MAX_DATA: usize;

    /// Reads a frame's data. Unknown codes are kept.
    ///
    /// # Errors
    /// The data is not a message of this side.
    fn decode(data: &[u8], framing: Framing) -> Result<Self, DecodeError>;

    /// Reads the frame at the start of `bytes`, which begin with a start mark, and its message: in place, if its data
    /// contains no DLE. `None` if more bytes are needed. The second value is the number of bytes that the frame has on the
    /// line.
    ///
    /// # Errors
    /// The frame is corrupt, or its data is not a message of this side.
    fn decode_frame(bytes: &[u8], framing: Framing) -> Result<Option<(Self, usize)>, DecodeError> {
        if let Some(data) = plain_data(bytes, bytes.len(), framing)
            && let Ok(message) = Self::decode(data, framing)
        {
            return Ok(Some((message, plain_len(data, framing))));
        }
        let Some((frame, length)) = Frame::decode_limited(bytes, framing, Self::MAX_DATA)? else {
            return Ok(None);
        };
        Self::decode(frame.data(), framing).map(|message| Some((message, length)))
    }

    /// Returns the frame of this message.
    fn frame(&self) -> Frame;

    /// Returns whether the source names every code in the message. A frame that was found inside the bytes of a corrupt
    /// frame has passed only an 8-bit sum, and must also pass this check.
    fn is_plausible(&self) -> bool;

    /// Writes the message's frame and returns its length.
    ///
    /// # Errors
    /// The output is too short.
    fn encode(&self, framing: Framing, out: &mut [u8]) -> Result<usize, EncodeError> {
        self.frame().encode(framing, out)
    }

    /// Returns the length of the message's frame on the line.
    fn encoded_len(&self, framing: Framing) -> usize {
        self.frame().encoded_len(framing)
    }

    /// Appends the message's frame to a growing buffer.
    #[cfg(feature = "bytes")]
    fn append_to(&self, framing: Framing, out: &mut impl bytes::BufMut) {
        let mut frame = [0; Frame::MAX_LEN];
        if let Ok(len) = self.encode(framing, &mut frame) {
            out.put_slice(frame.get(..len).unwrap_or_default());
        }
    }
}

/// A message with the envelope in which it is written: the item of a framed transport (`robot_session::tokio::Codec`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Framed<M> {
    /// The message in the envelope.
    pub message: M,
    /// The envelope of the message.
    pub framing: Framing,
}

impl<M: Message> Encode for Framed<M> {
    type Error = EncodeError;

    fn encoded_len(&self) -> usize {
        self.message.encoded_len(self.framing)
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        self.message.encode(self.framing, out)
    }
}

/// Closes [`Message`].
#[cfg(not(feature = "arbitrary"))]
pub trait Sealed {}

/// Closes [`Message`].
#[cfg(feature = "arbitrary")]
pub trait Sealed: for<'a> arbitrary::Arbitrary<'a> {}
