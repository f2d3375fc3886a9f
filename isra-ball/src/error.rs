use core::time::Duration;

/// The fault of the ball or of the line.
///
/// Offsets count from the first byte of the packet; the packet's offset in the stream follows from
/// [`Decoder::position`](robot_session::Decoder::position).
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum DecodeError {
    /// The header must be n, −n and n XOR 55h (§4.2).
    #[error("no packet header: byte {offset} is {found:#04x}, not {expected:#04x}")]
    Header {
        /// The offset of the byte that does not fit the first: 1 or 2.
        offset: usize,
        /// The byte that belongs there, by the first byte.
        expected: u8,
        /// The byte that came in its place.
        found: u8,
    },
    /// Bytes that no packet header begins. Only the stream decoder gives it.
    #[error("{length} bytes without a packet header")]
    Noise {
        /// The number of bytes that were skipped.
        length: usize,
    },
    /// The sum of n, the data bytes and the checksum must be 0 modulo 256 (§4.2).
    #[error("checksum is {found:#04x}, the data gives {expected:#04x} (at byte {offset})")]
    Checksum {
        /// The offset of the checksum in the packet.
        offset: usize,
        /// The checksum of the bytes before it.
        expected: u8,
        /// The checksum in the packet.
        found: u8,
    },
    /// The stream paused or ended inside a packet. On a line with XON/XOFF switched on the lost force values 17 and 19 have
    /// this effect.
    #[error("packet ends after {found} of {expected} bytes")]
    Incomplete {
        /// The number of bytes of the whole packet by its length byte, checksum included.
        expected: usize,
        /// The number of bytes of the packet that came.
        found: usize,
    },
    /// A good packet, but not of the eight data bytes whose meaning the source gives: the DIP switches are set another way
    /// (§4.1).
    #[error("packet has {found} data bytes, only the layout of {expected} is known")]
    Layout {
        /// The number of data bytes of the known layout: 8.
        expected: usize,
        /// The number of data bytes of the packet, its n.
        found: usize,
    },
}

/// The fault of the caller: a value that the wire cannot carry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum EncodeError {
    /// The output slice is too short.
    #[error("output has room for {available} bytes, {needed} are needed")]
    BufferTooSmall {
        /// The number of bytes of the packet.
        needed: usize,
        /// The number of free bytes of the output.
        available: usize,
    },
    /// The sensor type has three bits (§4.2).
    #[error("sensor type {found} is not in 0..=7")]
    SensorType {
        /// The sensor type that was given, above 7.
        found: u8,
    },
    /// The sensor number has three bits (§4.2).
    #[error("sensor number {found} is not in 0..=7")]
    Sensor {
        /// The sensor number that was given, above 7.
        found: u8,
    },
    /// Only packets of eight data bytes are written.
    #[error("a packet has {expected} data bytes, not {found}")]
    Layout {
        /// The number of data bytes of the known layout: 8.
        expected: usize,
        /// The number of data bytes that were given.
        found: usize,
    },
}

/// The fault of the caller: a session that cannot work as configured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ConfigError {
    /// A poll and its packet do not fit the line in this period.
    #[error("poll period {found:?} is shorter than {minimum:?}, the time of a poll and its packet")]
    Period {
        /// [`timing::min_period`](crate::timing::min_period) of the baud rate.
        minimum: Duration,
        /// The period of the configuration.
        found: Duration,
    },
    /// Values could become too old although nothing goes wrong.
    #[error("the maximum age {found:?} must be above {minimum:?}, the age reached between two replies")]
    MaxAge {
        /// Twice the period or the reply window, whichever is longer, and one reply window more.
        minimum: Duration,
        /// The age of the configuration.
        found: Duration,
    },
    /// The ball's own identity does not fit its ID byte.
    #[error(transparent)]
    Identity(#[from] EncodeError),
}
