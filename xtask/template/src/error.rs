/// The fault of the peer or of the line. Offsets count from the first byte of the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum DecodeError {
    /// A line begins with `G` or `V`.
    #[error("line begins with {found:#04x}, not with G or V")]
    Letter {
        /// The byte that came.
        found: u8,
    },
    /// A number is decimal, without leading zeros or a plus sign, and in its range.
    #[error("expected a number in its range at byte {offset}")]
    Number {
        /// The offset at which it begins.
        offset: usize,
    },
    /// The value of a register is after `=`.
    #[error("no = between register and value")]
    Separator,
    /// No line is so long.
    #[error("{length} bytes without the end of a line")]
    TooLong {
        /// The bytes.
        length: usize,
    },
    /// The stream ended inside a line.
    #[error("line ends after {length} bytes without its line feed")]
    Incomplete {
        /// The bytes.
        length: usize,
    },
}

/// The fault of the caller: a message that cannot be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum EncodeError {
    /// The output slice is too short.
    #[error("output has room for {available} bytes, {needed} are needed")]
    BufferTooSmall {
        /// The bytes needed.
        needed: usize,
        /// The free bytes of the output.
        available: usize,
    },
}

/// The fault of the caller: the reason that the session rejects a call.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum SessionError {
    /// There is no connection.
    #[error("there is no connection")]
    NotConnected,
    /// The previous request has no outcome yet, or the events were not polled.
    #[error("the previous request has no outcome yet, or its event is not fetched")]
    Busy,
    /// Nothing was asked for.
    #[error("there is no open request")]
    NotAsked,
}

/// The fault of the caller: a session that cannot work as configured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ConfigError {
    /// No reply could come in time.
    #[error("the timeout is zero")]
    Timeout,
}
