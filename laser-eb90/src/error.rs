//! Errors: [`DecodeError`] is the peer's or the line's fault, [`EncodeError`], [`SessionError`] and [`ConfigError`] are the
//! caller's.

/// Bytes that are no frame.
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
        /// How many bytes.
        skipped: usize,
    },
    /// The head is not followed by the frame flag: a false head, or a corrupt flag.
    #[error("expected the frame flag {expected:02X}h, found {found:02X}h (at byte {offset})")]
    Flag {
        /// Its place in the frame.
        offset: usize,
        /// The flag.
        expected: u8,
        /// What is there.
        found: u8,
    },
    /// A 90h that is neither doubled nor the beginning of the tail (§3(2)).
    #[error("90h is followed by {found:02X}h, which is neither 90h nor a tail (at byte {offset})")]
    Stuffing {
        /// The place of the byte after 90h in the frame.
        offset: usize,
        /// That byte.
        found: u8,
    },
    /// No tail within the longest payload that is taken.
    #[error("the payload is longer than {limit} bytes (at byte {offset})")]
    TooLong {
        /// The place in the frame of the first byte too many.
        offset: usize,
        /// The longest payload.
        limit: usize,
    },
    /// The check word is not that of the unstuffed payload (校验字, §3(3)).
    #[error("the checksum is {found:X}h, the payload's is {expected:X}h (at byte {offset})")]
    Checksum {
        /// The place of the checksum in the frame.
        offset: usize,
        /// The payload's.
        expected: u16,
        /// The frame's.
        found: u16,
    },
    /// A byte that is no tag where one must be. In front of the payload it shows a false head.
    #[error("{found:02X}h is not a tag (at payload byte {offset})")]
    Tag {
        /// Its place in the payload.
        offset: usize,
        /// The byte.
        found: u8,
    },
    /// An item needs more bytes than the payload holds.
    #[error("an item needs {needed} bytes, the payload has {found} left (at payload byte {offset})")]
    Item {
        /// The place of the item's tag in the payload.
        offset: usize,
        /// Tag, count and values.
        needed: usize,
        /// What is left, from the tag on.
        found: usize,
    },
    /// The payload does not begin with a command word: it is no instruction and no reply.
    #[error("the payload does not begin with a command word")]
    NoWord,
    /// The line is silent, or the input ended, within a frame or in bytes without a head.
    #[error("{held} bytes are not a complete frame")]
    Incomplete {
        /// How many bytes.
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
        /// The bytes to write.
        needed: usize,
        /// The room there is.
        available: usize,
    },
    /// An item's count is one byte.
    #[error("an item holds at most 255 values, not {count}")]
    TooManyValues {
        /// How many there were.
        count: usize,
    },
    /// A frame needs at least one item: its first byte distinguishes a head from a false one.
    #[error("a frame without items")]
    Empty,
    /// A NaN or an infinity: no position, no angle and no power is one.
    #[error("value {index} is not finite")]
    NotFinite {
        /// Its place in the item, from 0.
        index: usize,
    },
}

/// A request that a session cannot fulfil: the caller's fault. Nothing has changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum SessionError {
    /// The next frame has no room for the instruction, or it must travel alone. Send first.
    #[error("the next frame has no room for this instruction")]
    Full,
    /// A word that is not a command word.
    #[error("{word:04X}h is not a command word")]
    UnknownWord {
        /// The word.
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
        /// The word.
        word: u16,
        /// One of its meanings.
        first: WordUse,
        /// The other.
        second: WordUse,
    },
    /// More ranges of command words than a set of words holds.
    #[error("a set of words has at most {limit} ranges of command words")]
    TooManyRanges {
        /// How many it holds.
        limit: usize,
    },
}

/// What a word is used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum WordUse {
    /// It is a command word.
    Command,
    /// It is an error code.
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
