use core::time::Duration;

/// The fault of the host or of the line.
///
/// Offsets count from the first byte of the line; the line's offset in the stream follows from
/// [`Decoder::position`](robot_session::Decoder::position).
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum DecodeError {
    /// A line with another byte in place of a fixed one.
    #[error("byte {offset} of the line does not match the format")]
    Format {
        /// The offset of the byte in the line, from 0.
        offset: usize,
    },
    /// A line with a missing number, or with one outside its range: 0..=65535 for the count, −32768..=32767 for a word.
    #[error("the number at byte {offset} of the line is missing or out of range")]
    Number {
        /// The offset of the number in the line, from 0.
        offset: usize,
    },
    /// A line with the wrong checksum.
    #[error("checksum is {found:#04x}, the line gives {expected:#04x}")]
    Checksum {
        /// The checksum of the line's bytes.
        expected: u8,
        /// The checksum in the line.
        found: u8,
    },
    /// A line that is longer than the longest packet.
    #[error("line has more than {limit} bytes")]
    TooLong {
        /// The number of bytes of the longest packet.
        limit: usize,
    },
    /// The next line began before this one ended, or the stream ended. Only the stream decoder gives it.
    #[error("line ends after {length} bytes")]
    Incomplete {
        /// The number of bytes of the line that came.
        length: usize,
    },
    /// Bytes that no `$` begins. Only the stream decoder gives it.
    #[error("{length} bytes without a line")]
    Noise {
        /// The number of bytes that were skipped.
        length: usize,
    },
}

impl DecodeError {
    /// Returns whether the bytes were a whole line: a packet that cannot be decoded, so an answer.
    pub const fn is_line(&self) -> bool {
        match self {
            Self::Format { .. } | Self::Number { .. } | Self::Checksum { .. } | Self::TooLong { .. } => true,
            Self::Incomplete { .. } | Self::Noise { .. } => false,
        }
    }
}

/// The fault of the caller: a message does not fit the output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum EncodeError {
    /// The output is too short.
    #[error("output has room for {available} bytes, {needed} are needed")]
    BufferTooSmall {
        /// The number of bytes of the message.
        needed: usize,
        /// The number of free bytes of the output.
        available: usize,
    },
}

/// The fault of the caller: a session that cannot work as configured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ConfigError {
    /// Without an interval, each of the requests that have piled up is answered (§9.4).
    #[error("the interval between two packets is zero")]
    Interval,
    /// A pose would be too old as soon as it is set.
    #[error("the maximum age of a pose is zero")]
    MaxAge,
    /// No XOFF would hold anything.
    #[error("the longest hold of the line is zero")]
    MaxHold,
    /// Every display cycle would be taken for a pause, and would send a request.
    #[error("a pause of {found:?} must be longer than the display cycle of {minimum:?}")]
    Pause {
        /// The display cycle, [`timing::CYCLE`](crate::timing::CYCLE).
        minimum: Duration,
        /// The pause of the configuration.
        found: Duration,
    },
    /// The picture would be reported as stale between two poses of a host that does nothing wrong.
    #[error("the stale time {found:?} must be longer than the display cycle of {minimum:?}")]
    StaleAfter {
        /// The display cycle, [`timing::CYCLE`](crate::timing::CYCLE).
        minimum: Duration,
        /// The time of the configuration.
        found: Duration,
    },
}
