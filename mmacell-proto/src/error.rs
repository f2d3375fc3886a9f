//! [`DecodeError`] is the peer's fault; [`EncodeError`], [`SessionError`] and [`ConfigError`] are the caller's.

use core::fmt;

/// The reason that a line is not a command or a reply. Offsets count from the beginning of the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum DecodeError {
    /// No line of this protocol is this long. All of it, up to its end, is dropped.
    #[error("no end of the line within {limit} bytes")]
    TooLong {
        /// The longest line that is looked at, its end included.
        limit: usize,
    },
    /// The stream ends within a line.
    #[error("the stream ends within a line")]
    Incomplete,
    /// The first three characters name no command (§4).
    #[error("there is no command {:?}", Text(found))]
    UnknownCommand {
        /// The first three characters of the line.
        found: [u8; 3],
    },
    /// The first two characters are neither `OK` nor `ER` (§4).
    #[error("a reply begins with OK or ER, not with {:?}", Text(found))]
    UnknownReply {
        /// The first two characters of the line.
        found: [u8; 2],
    },
    /// A character that its field does not allow.
    #[error("{:?} at byte {offset}, where {expected} is expected", *found as char)]
    Unexpected {
        /// The offset of the character in the line, from 0.
        offset: usize,
        /// The character that is not allowed.
        found: u8,
        /// The characters that the field allows there.
        expected: Expected,
    },
    /// The line ends within a field, or before one.
    #[error("the line ends at byte {offset}, where {expected} is expected")]
    Short {
        /// The offset of the end of the line, from 0.
        offset: usize,
        /// The characters that should follow.
        expected: Expected,
    },
    /// The line continues after its last field.
    #[error("expected the end of the line at byte {offset}")]
    Trailing {
        /// The offset of the first byte too many, from 0.
        offset: usize,
    },
    /// Five digits that 16 bits cannot hold (§4).
    #[error("the integer {found} at byte {offset} is outside −32768 to 32767")]
    IntegerRange {
        /// The offset of the field in the line, from 0.
        offset: usize,
        /// The value of the field.
        found: i32,
    },
    /// An override outside 0 to 100 % (§4.3).
    #[error("the override {found} % at byte {offset} is outside 0 to 100 %")]
    Percent {
        /// The offset of the field in the line, from 0.
        offset: usize,
        /// The value of the field, in percent.
        found: i32,
    },
    /// `ER` with the number that means "no error" (§5).
    #[error("an error reply with the number 0, which means no error")]
    ErrorZero,
}

/// The characters that a field allows at an offset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Expected {
    /// The three letters of a command.
    Command,
    /// The two letters of a reply, `OK` or `ER`.
    Reply,
    /// A sign, `+` or `-`.
    Sign,
    /// A digit, `0` to `9`.
    Digit,
    /// A decimal point, `.`.
    Point,
    /// A truth value, `T` or `F`.
    TrueOrFalse,
    /// The mode of a motion, `A` or `R`.
    AbsoluteOrRelative,
    /// The state of the servo motors, `ON` or `OF`.
    OnOrOff,
    /// The state of a gripper, `OPEN` or `CLOSE`.
    OpenOrClose,
    /// The end of the line: this kind of device has no axes and no status.
    NoAxes,
}

impl fmt::Display for Expected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Command => "a command",
            Self::Reply => "OK or ER",
            Self::Sign => "+ or -",
            Self::Digit => "a digit",
            Self::Point => "a decimal point",
            Self::TrueOrFalse => "T or F",
            Self::AbsoluteOrRelative => "A or R",
            Self::OnOrOff => "ON or OF",
            Self::OpenOrClose => "OPEN or CLOSE",
            Self::NoAxes => "no axis",
        })
    }
}

/// The reason that a message has no form on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum EncodeError {
    /// The buffer is too small.
    #[error("{needed} bytes are needed, the buffer has {found}")]
    Buffer {
        /// The number of bytes of the message.
        needed: usize,
        /// The number of bytes of the buffer.
        found: usize,
    },
    /// A coordinate beyond three digits before the point of millimetres, or two of radians. Fields are never widened.
    #[error("axis {axis} at {found} is outside ±999999 (units of the last digit: 1 µm or 0.1 mrad)")]
    AxisRange {
        /// The index of the axis, from 0.
        axis: usize,
        /// The coordinate, in micrometres or tenths of a milliradian.
        found: i32,
    },
    /// An integer beyond 16 bits, or in a dialect of five digits beyond those.
    #[error("the integer {found} does not fit its field")]
    IntegerRange {
        /// The integer that was given.
        found: i32,
    },
    /// An override above 100 %.
    #[error("the override {found} % is above 100 %")]
    Percent {
        /// The override that was given, in percent.
        found: u8,
    },
    /// An error reply with the number that means "no error".
    #[error("an error reply needs a number other than 0")]
    ErrorZero,
}

/// The reason that a session refuses a call.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum SessionError {
    /// A command is not finished, or its outcome has not been polled.
    #[error("the last command has no outcome yet: only one can be outstanding")]
    Busy,
    /// There is no connection, or it has ended.
    #[error("there is no connection")]
    NotConnected,
    /// The owner accepts or refuses an order that is not pending.
    #[error("this order is not pending")]
    NotPending,
    /// The order has become impossible since it was requested, and is refused.
    #[error("the order is no longer possible and is refused")]
    NotPossible,
    /// The command has no form on the wire.
    #[error(transparent)]
    #[cfg_attr(feature = "serde", serde(untagged))]
    Encode(#[from] EncodeError),
}

/// The reason that a session cannot work as configured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ConfigError {
    /// Every reply would be overdue at once.
    #[error("the timeout of a reply is 0")]
    Timeout,
    /// The error number of a refusal has no form on the wire.
    #[error("the error number of a refusal is 0, or does not fit its field")]
    Refusal,
}

/// Bytes as the text that they were meant to be.
struct Text<'a>(&'a [u8]);

impl fmt::Debug for Text<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "\"{}\"", self.0.escape_ascii())
    }
}
