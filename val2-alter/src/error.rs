//! The errors: [`DecodeError`] is the peer's fault; [`EncodeError`], [`SessionError`] and [`ConfigError`] are the
//! caller's.

use crate::message::ErrorCode;

/// Bytes that are not a message of this link. Offsets count from the first byte that was ever given to the decoder
/// (or from the start of the slice), and wrap around with `usize`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum DecodeError {
    /// Bytes without a start mark before them (§3.2).
    #[error("{length} bytes at byte {offset} are not part of a frame")]
    StartMark {
        /// The offset of the first of these bytes.
        offset: usize,
        /// The number of bytes up to the next start mark.
        length: usize,
    },
    /// Inside a frame, DLE is followed by neither DLE nor ETX (§3.2).
    #[error(
        "DLE is followed by {found:#04x} at byte {offset}: neither a doubled DLE nor the end of the frame"
    )]
    EndMark {
        /// The offset of the byte after the DLE.
        offset: usize,
        /// The byte after the DLE.
        found: u8,
    },
    /// The checksum is not the sum of the data (§3.2).
    #[error("checksum is {found:#04x}, the data gives {expected:#04x} (at byte {offset})")]
    Checksum {
        /// The offset of the checksum.
        offset: usize,
        /// The sum of the data.
        expected: u8,
        /// The checksum that came.
        found: u8,
    },
    /// More data than any message of this side has: the end of the frame was lost.
    #[error("frame at byte {offset} has more than {limit} data bytes")]
    TooLong {
        /// The offset of the frame's first byte.
        offset: usize,
        /// The most data bytes that a message of this side has.
        limit: usize,
    },
    /// The line fell silent in the middle of a frame.
    #[error("frame at byte {offset} is cut off after {length} bytes")]
    Incomplete {
        /// The offset of the frame's first byte.
        offset: usize,
        /// The number of bytes of the frame that arrived.
        length: usize,
    },
    /// The control byte is not `1mm00eee` (§3.2.2).
    #[error("control byte {found:#04x} of the frame at byte {offset} is not 1mm00eee")]
    Control {
        /// The offset of the frame's first byte.
        offset: usize,
        /// The control byte that came.
        found: u8,
    },
    /// No message of this side has that many data bytes (§3.2.1, §3.2.2).
    #[error("{found} data bytes in the frame at byte {offset} do not match any message")]
    Length {
        /// The offset of the frame's first byte.
        offset: usize,
        /// The number of data bytes.
        found: usize,
    },
    /// The answer to a start message is not 00, 01 or FF (§3.3.1).
    #[error("start reply {found:#04x} of the frame at byte {offset} is neither 0x00 nor 0x01 nor 0xff")]
    StartReply {
        /// The offset of the frame's first byte.
        offset: usize,
        /// The code of the reply.
        found: u8,
    },
    /// The select byte sets bit 6 or 7, which name no axis (§3.3.2).
    #[error("select byte {found:#04x} of the frame at byte {offset} sets bits without an axis")]
    Select {
        /// The offset of the frame's first byte.
        offset: usize,
        /// The select byte that came.
        found: u8,
    },
    /// The reply does not hold one word for each bit of its select byte (§3.3.2).
    #[error("reply at byte {offset} selects {expected} data bytes but has {found}")]
    ReplyLength {
        /// The offset of the frame's first byte.
        offset: usize,
        /// The number of data bytes for the select byte.
        expected: usize,
        /// The number of data bytes that arrived.
        found: usize,
    },
}

impl DecodeError {
    /// Returns the code with which a controller reports the error to its host (§3.2.2).
    pub fn code(self) -> ErrorCode {
        match self {
            Self::StartMark { .. } | Self::EndMark { .. } => ErrorCode::Mark,
            Self::Checksum { .. } => ErrorCode::Checksum,
            Self::TooLong { .. } => ErrorCode::Overflow,
            Self::Incomplete { .. } => ErrorCode::Incomplete,
            Self::Control { .. }
            | Self::Length { .. }
            | Self::StartReply { .. }
            | Self::Select { .. }
            | Self::ReplyLength { .. } => ErrorCode::Format,
        }
    }

    /// Returns the offset of the error: of the first wrong byte, or of the wrong frame.
    pub fn offset(self) -> usize {
        match self {
            Self::StartMark { offset, .. }
            | Self::EndMark { offset, .. }
            | Self::Checksum { offset, .. }
            | Self::TooLong { offset, .. }
            | Self::Incomplete { offset, .. }
            | Self::Control { offset, .. }
            | Self::Length { offset, .. }
            | Self::StartReply { offset, .. }
            | Self::Select { offset, .. }
            | Self::ReplyLength { offset, .. } => offset,
        }
    }

    /// Returns the same error, `by` bytes later in the stream.
    pub(crate) fn shifted(mut self, by: usize) -> Self {
        match &mut self {
            Self::StartMark { offset, .. }
            | Self::EndMark { offset, .. }
            | Self::Checksum { offset, .. }
            | Self::TooLong { offset, .. }
            | Self::Incomplete { offset, .. }
            | Self::Control { offset, .. }
            | Self::Length { offset, .. }
            | Self::StartReply { offset, .. }
            | Self::Select { offset, .. }
            | Self::ReplyLength { offset, .. } => *offset = offset.wrapping_add(by),
        }
        self
    }
}

/// A message that cannot be written, or a value that its field cannot hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum EncodeError {
    /// The output slice cannot hold the frame; nothing was written.
    #[error("frame has {needed} bytes, the output has room for {available}")]
    BufferTooSmall {
        /// The number of bytes of the frame.
        needed: usize,
        /// The number of bytes of the slice.
        available: usize,
    },
    /// More data than a frame of this link holds.
    #[error("{found} data bytes exceed the {limit} of a frame")]
    TooLong {
        /// The number of data bytes.
        found: usize,
        /// The largest number of data bytes that fits.
        limit: usize,
    },
    /// A length or an angle outside the range of its 16-bit word (§3.3.2: ±1024 mm, ±180°).
    #[error("{found} units do not fit a word of -32768..=32767")]
    Range {
        /// The value in units of the word, rounded; at the end of its range when it is further away (or no number).
        found: i32,
    },
}

/// A call that the session's state or its configuration does not allow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum SessionError {
    /// The ALTER instruction names no exception subroutine: an exception would abort the robot's program (§3).
    #[error("no exception subroutine is installed: an exception would abort the robot's program")]
    NoSubroutine,
    /// No ALTER is running, and the call needs one.
    #[error("ALTER is not running")]
    NotRunning,
    /// The exception before this one has not been sent yet.
    #[error("exception {pending} is not yet sent")]
    ExceptionPending {
        /// The code of the exception that waits.
        pending: u8,
    },
    /// An ALTER runs already; it must end before the next one starts.
    #[error("ALTER is already started")]
    AlreadyStarted,
    /// The port is not open.
    #[error("not connected")]
    NotConnected,
    /// The event queue is full of outcomes that are not polled yet.
    #[error("event queue full")]
    EventsFull,
}

/// A configuration that cannot work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ConfigError {
    /// The reply window, which the mode's shortest message leaves of a cycle, is too short for a reply with one
    /// value.
    #[error(
        "at {baud} baud no value fits the reply window of mode {mode}: take a higher baud rate or a mode without transformation"
    )]
    Window {
        /// The configured rate of the line, in baud.
        baud: u32,
        /// The configured mode, as the mode byte of a start message.
        mode: u8,
    },
    /// A controller counts as lost after two cycles at the earliest: messages are a cycle apart.
    #[error("the loss timeout of {found} cycles is too short: messages are one cycle apart")]
    SilenceCycles {
        /// The configured number of cycles.
        found: u32,
    },
    /// A controller makes at least one attempt to start.
    #[error("the number of start attempts is 0")]
    Attempts,
}
