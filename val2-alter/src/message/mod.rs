//! Typed messages inside the envelope: [`RobotMessage`] one way, [`HostMessage`] the other.

mod codes;
mod host;
mod mode;
mod robot;

pub use codes::{ErrorCode, Exception, SegmentStatus, StartCode};
pub use host::{AXES, HostMessage, Reply};
pub use mode::{Accumulation, CoordinateFrame, Mode, Polarity};
pub use robot::{End, List, Motion, MotionPhase, RobotMessage, Start};

use crate::{DecodeError, EncodeError, Frame, Framing};

/// What one side of the link says. Implemented by [`RobotMessage`] and [`HostMessage`], and closed.
pub trait Message: Copy + core::fmt::Debug + PartialEq + sealed::Sealed {
    /// The most data bytes that a message of this side has.
    const MAX_DATA: usize;

    /// Reads a frame's data. Unknown codes are kept.
    fn decode(data: &[u8], framing: Framing) -> Result<Self, DecodeError>;

    /// The frame that says this.
    fn frame(&self) -> Frame;

    /// Whether every code in it is one that the source names. A frame that was found inside the bytes of a damaged one
    /// has passed only an 8-bit sum, and must also pass this.
    fn is_plausible(&self) -> bool;

    /// Writes the message's frame and returns its length.
    fn encode(&self, framing: Framing, out: &mut [u8]) -> Result<usize, EncodeError> {
        self.frame().encode(framing, out)
    }

    /// The length of the message's frame on the line.
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

mod sealed {
    pub trait Sealed {}
    impl Sealed for super::RobotMessage {}
    impl Sealed for super::HostMessage {}
}
