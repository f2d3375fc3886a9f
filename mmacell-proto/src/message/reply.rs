use robot_session::Encode;

use super::in_dialect::InDialect;
use crate::dialect::Dialect;
use crate::error::{DecodeError, EncodeError, Expected};
use crate::fields::{Reader, Writer, end_len, integer_fits, integer_len};
use crate::frame::Line;
use crate::pose::Pose;

/// A reply of a device whose axes are `P` (§4).
///
/// | on the wire | length with its end |
/// | --- | --- |
/// | `OK` | 4 |
/// | `ER+00001` | 10 |
/// | `OKF+010.000-002.000+005.999-01.2322T+00080+00000` (robot's status) | 50 |
/// | `OKF+00.5000-00.2500T+00080+00000` (platform's status) | 34 |
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "reply", rename_all = "snake_case"))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum Reply<P> {
    /// `OK`: the command is done, or for a motion, started.
    Ok,
    /// `ER`: the command is not done.
    Error {
        /// The reason; never [`ErrorCode::None`].
        #[cfg_attr(feature = "arbitrary", arbitrary(with = failure))]
        error: ErrorCode,
    },
    /// `OK` and the answer to `STA`.
    Status(Status<P>),
}

/// The status of a device (§4.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Status<P> {
    /// Whether a motion is going on. It may be false until a motion that the device has accepted begins.
    pub moving: bool,
    /// The pose of the axes.
    #[cfg_attr(feature = "serde", serde(rename = "axes"))]
    pub pose: P,
    /// Whether the servo motors are on.
    pub servo: bool,
    /// The override, 0 to 100 %.
    #[cfg_attr(feature = "serde", serde(rename = "override"))]
    #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::percent))]
    pub percent: u8,
    /// The error that the device is in; [`ErrorCode::None`] without one.
    pub error: ErrorCode,
}

/// An error number (§5). The source calls its list provisional.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(from = "i32", into = "i32")
)]
pub enum ErrorCode {
    /// 0: there is no error.
    #[default]
    None,
    /// 1: an error without a number of its own.
    Generic,
    /// 2: error of servo motor 1.
    Servo1,
    /// 3: error of servo motor 2.
    Servo2,
    /// Any other number; 16 bits on the wire.
    Other(i32),
}

impl<P: Pose> Reply<P> {
    /// The longest reply with its end, in any dialect, in bytes: 50, and two blanks.
    pub const MAX_LEN: usize = 52;

    /// Decodes the reply in a line.
    ///
    /// # Errors
    /// The line is not a reply of such a device.
    #[inline]
    pub fn decode(line: Line<'_>, dialect: &Dialect) -> Result<Self, DecodeError> {
        let mut reader = Reader::new(line.content(), dialect);
        let head = reader.take(Expected::Reply)?;
        let reply = if head == b"OK" && reader.rest().is_empty() {
            Self::Ok
        } else if head == b"OK" {
            let (moving, pose, servo) = (reader.flag()?, P::read(&mut reader)?, reader.flag()?);
            let (percent, error) = reader.percent_and_error()?;
            Self::Status(Status { moving, pose, servo, percent, error: error.into() })
        } else if head == b"ER" {
            Self::Error { error: read_error(&mut reader)? }
        } else {
            return Err(DecodeError::UnknownReply { found: *head });
        };
        reader.end()?;
        Ok(reply)
    }

    /// Returns the reply in the form of a dialect: with each of the dialect's readings in place of the source's own.
    pub const fn in_dialect(self, dialect: Dialect) -> InDialect<Self> {
        InDialect { message: self, dialect }
    }

    /// Appends the reply with its end, as the source defines it.
    ///
    /// # Errors
    /// A value does not fit its field, or the message does not fit the buffer; nothing is appended.
    #[cfg(feature = "bytes")]
    pub fn append_to(&self, buffer: &mut impl bytes::BufMut) -> Result<(), EncodeError> {
        self.in_dialect(Dialect::STRICT).append_to(buffer)
    }

    pub(super) fn len_in(&self, dialect: &Dialect) -> usize {
        let content = match self {
            Self::Ok => 2,
            Self::Error { .. } => 2 + integer_len(dialect),
            Self::Status(status) => 4 + status.pose.encoded_len() + 2 * integer_len(dialect),
        };
        content + end_len(dialect)
    }

    pub(super) fn write(&self, dialect: &Dialect, buffer: &mut [u8]) -> Result<usize, EncodeError> {
        let len = self.len_in(dialect);
        let mut writer = Writer::new(buffer, len, dialect)?;
        match self {
            Self::Ok => writer.put(b"OK"),
            Self::Error { error: ErrorCode::None | ErrorCode::Other(0) } => {
                return Err(EncodeError::ErrorZero);
            }
            Self::Error { error } => {
                writer.put(b"ER");
                writer.integer((*error).into())?;
            }
            Self::Status(status) => {
                writer.put(b"OK");
                writer.flag(status.moving);
                status.pose.write(&mut writer)?;
                writer.flag(status.servo);
                writer.percent(status.percent)?;
                writer.integer(status.error.into())?;
            }
        }
        writer.end();
        Ok(len)
    }
}

/// As the source defines it.
impl<P: Pose> Encode for Reply<P> {
    type Error = EncodeError;

    fn encoded_len(&self) -> usize {
        self.len_in(&Dialect::STRICT)
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        self.write(&Dialect::STRICT, out)
    }
}

impl ErrorCode {
    /// Returns whether an error reply can contain the number: not 0, and within its field.
    pub fn has_form(self, dialect: &Dialect) -> bool {
        let number = self.into();
        number != 0 && integer_fits(number, dialect)
    }
}

impl From<i32> for ErrorCode {
    fn from(number: i32) -> Self {
        match number {
            0 => Self::None,
            1 => Self::Generic,
            2 => Self::Servo1,
            3 => Self::Servo2,
            other => Self::Other(other),
        }
    }
}

impl From<ErrorCode> for i32 {
    fn from(code: ErrorCode) -> Self {
        match code {
            ErrorCode::None => 0,
            ErrorCode::Generic => 1,
            ErrorCode::Servo1 => 2,
            ErrorCode::Servo2 => 3,
            ErrorCode::Other(other) => other,
        }
    }
}

impl core::fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::None => f.write_str("no error"),
            Self::Generic => f.write_str("generic error (1)"),
            Self::Servo1 => f.write_str("error of servo motor 1 (2)"),
            Self::Servo2 => f.write_str("error of servo motor 2 (3)"),
            Self::Other(other) => write!(f, "error {other}"),
        }
    }
}

/// Reads an error reply; out of line, because most replies are `OK`.
#[cold]
fn read_error(reader: &mut Reader<'_>) -> Result<ErrorCode, DecodeError> {
    match reader.integer()?.into() {
        ErrorCode::None => Err(DecodeError::ErrorZero),
        error => Ok(error),
    }
}

#[cfg(feature = "arbitrary")]
impl<'a> arbitrary::Arbitrary<'a> for ErrorCode {
    fn arbitrary(u: &mut arbitrary::Unstructured<'a>) -> arbitrary::Result<Self> {
        crate::arbitrary::integer(u).map(Into::into)
    }
}

/// Generates the number of an error reply: not 0.
#[cfg(feature = "arbitrary")]
fn failure(u: &mut arbitrary::Unstructured<'_>) -> arbitrary::Result<ErrorCode> {
    let error = u.arbitrary()?;
    Ok(if error == ErrorCode::None { ErrorCode::Generic } else { error })
}
