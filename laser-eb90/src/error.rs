//! Errors: [`DecodeError`] is the peer's or the line's fault, [`EncodeError`], [`SessionError`] and [`ConfigError`] are the
//! caller's.

/// Bytes that are not a frame.
///
/// Offsets into a frame count from its first byte on the wire, offsets into a payload count unstuffed bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum DecodeError {
    /// Bytes that no head `EB 90 82` begins (帧头, §3(2)).
    #[error("no frame head in {skipped} bytes")]
    NoHead {
        /// The number of bytes without a head.
        skipped: usize,
    },
    /// The head is not followed by the frame flag: a false head, or a corrupt flag.
    #[error("expected the frame flag {expected:02X}h, found {found:02X}h (at byte {offset})")]
    Flag {
        /// The offset of the flag in the frame.
        offset: usize,
        /// The frame flag of the profile.
        expected: u8,
        /// The byte in its place.
        found: u8,
    },
    /// A 90h that is neither doubled nor the beginning of the tail (§3(2)).
    #[error("90h is followed by {found:02X}h, which is neither 90h nor a tail (at byte {offset})")]
    Stuffing {
        /// The offset in the frame of the byte after 90h.
        offset: usize,
        /// The byte after 90h, which is neither 90h nor the tail's.
        found: u8,
    },
    /// No tail within the longest payload that is taken.
    #[error("the payload is longer than {limit} bytes (at byte {offset})")]
    TooLong {
        /// The offset in the frame of the first byte too many.
        offset: usize,
        /// The length of the longest payload, in unstuffed bytes.
        limit: usize,
    },
    /// The check word is not that of the unstuffed payload (校验字, §3(3)).
    #[error("the checksum is {found:X}h, the payload's is {expected:X}h (at byte {offset})")]
    Checksum {
        /// The offset of the checksum in the frame.
        offset: usize,
        /// The checksum of the payload.
        expected: u16,
        /// The checksum in the frame.
        found: u16,
    },
    /// A byte that is not a tag in the position of one. Before the payload, it shows a false head.
    #[error("{found:02X}h is not a tag (at payload byte {offset})")]
    Tag {
        /// The offset of the byte in the payload.
        offset: usize,
        /// The byte in the position of a tag.
        found: u8,
    },
    /// An item needs more bytes than the payload holds.
    #[error("an item needs {needed} bytes, the payload has {found} left (at payload byte {offset})")]
    Item {
        /// The offset of the item's tag in the payload.
        offset: usize,
        /// The length of tag, count and values, in bytes.
        needed: usize,
        /// The remaining bytes, from the tag on.
        found: usize,
    },
    /// The payload does not begin with a command word: it is neither an instruction nor a reply.
    #[error("the payload does not begin with a command word")]
    NoWord,
    /// The line is silent, or the input ended, within a frame or in bytes without a head.
    #[error("{held} bytes are not a complete frame")]
    Incomplete {
        /// The number of bytes that came.
        held: usize,
    },
}

/// Values that no frame can carry, or a buffer too short for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum EncodeError {
    /// The buffer is too short.
    #[error("{needed} bytes are needed, the buffer has {available}")]
    BufferTooSmall {
        /// The number of bytes of the frame.
        needed: usize,
        /// The number of free bytes of the buffer.
        available: usize,
    },
    /// An item's count is one byte.
    #[error("an item holds at most 255 values, not {count}")]
    TooManyValues {
        /// The number of values of the item, above 255.
        count: usize,
    },
    /// A frame needs at least one item: its first byte distinguishes a head from a false one.
    #[error("a frame without items")]
    Empty,
    /// A NaN or an infinity: it is not a position, an angle or a power.
    #[error("value {index} is not finite")]
    NotFinite {
        /// The index of the value in the item, from 0.
        index: usize,
    },
}

/// A call that a session cannot fulfil: the caller's fault. It has no effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum SessionError {
    /// The instruction does not fit the next frame, or must travel alone. Send the frame first.
    #[error("the next frame has no room for this instruction")]
    Full,
    /// A word that is not a command word.
    #[error("{word:04X}h is not a command word")]
    UnknownWord {
        /// The word that was given.
        word: u16,
    },
    /// A single short among the parameters of an interpreted instruction would begin the next one; among those of another
    /// instruction it would if it is a command word.
    #[error("a single short as a parameter would be read as the next command word")]
    LoneShort,
    /// An answer, but no instruction is being executed, or its event has not been taken.
    #[error("no instruction is being executed")]
    NotExecuting,
    /// The parameters, or the values of an answer, do not fit a frame.
    #[error(transparent)]
    #[cfg_attr(feature = "serde", serde(untagged))]
    Encode(EncodeError),
}

/// An invalid configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ConfigError {
    /// A frame of no instruction.
    #[error("a batch must hold at least one instruction")]
    NoBatch,
    /// A line on which a frame never ends.
    #[error("the baud rate is 0")]
    NoBaud,
    /// A word that would have two meanings.
    #[error("{word:04X}h is {first} and {second} at once")]
    Ambiguous {
        /// The word with two meanings.
        word: u16,
        /// The first use of the word.
        first: WordUse,
        /// The second use of the word.
        second: WordUse,
    },
    /// More ranges of command words than a set of words holds.
    #[error("a set of words has at most {limit} ranges of command words")]
    TooManyRanges {
        /// The largest number of ranges.
        limit: usize,
    },
}

/// The use of a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum WordUse {
    /// The word is a command word.
    Command,
    /// The word is an error code.
    Error,
}

impl core::fmt::Display for WordUse {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            WordUse::Command => "a command word",
            WordUse::Error => "an error code",
        })
    }
}
