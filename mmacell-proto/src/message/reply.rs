use crate::fields::{Reader, Writer};
use crate::{DecodeError, Dialect, EncodeError, Expected, Line, Pose};

/// A reply of a device whose axes are `P` (§4).
///
/// | on the wire | length with its end |
/// | --- | --- |
/// | `OK` | 4 |
/// | `ER+00001` | 10 |
/// | `OKF+010.000-002.000+005.999-01.2322T+00080+00000` (robot's status) | 50 |
/// | `OKF+00.5000-00.2500T+00080+00000` (platform's status) | 34 |
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "reply", rename_all = "snake_case"))]
pub enum Reply<P> {
    /// `OK`: done, or for a motion, started.
    Ok,
    /// `ER`: not done.
    Error {
        /// Why; never [`ErrorCode::None`].
        error: ErrorCode,
    },
    /// `OK` and the answer to `STA`.
    Status(Status<P>),
}

/// The status of a device (§4.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Status<P> {
    /// A motion is going on. The device may say no until a motion that it has accepted begins.
    pub moving: bool,
    /// Where its axes stand.
    #[cfg_attr(feature = "serde", serde(rename = "axes"))]
    pub pose: P,
    /// Its servo motors are on.
    pub servo: bool,
    /// The override, 0 to 100 %.
    #[cfg_attr(feature = "serde", serde(rename = "override"))]
    pub percent: u8,
    /// The error that it is in.
    pub error: ErrorCode,
}

/// An error number (§5). The source calls its list provisional.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(from = "i32", into = "i32")
)]
pub enum ErrorCode {
    /// 0: no error.
    #[default]
    None,
    /// 1: generic error.
    Generic,
    /// 2: error of servo motor 1.
    Servo1,
    /// 3: error of servo motor 2.
    Servo2,
    /// Any other; 16 bits on the wire.
    Other(i32),
}

impl<P: Pose> Reply<P> {
    /// The longest reply with its end, in bytes.
    pub const MAX_LEN: usize = 50;

    /// The reply that a line holds.
    ///
    /// # Errors
    /// The line is no reply of such a device.
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

    /// Writes the reply with its end, and says how many bytes that took.
    ///
    /// # Errors
    /// A value does not fit its field, or the reply does not fit into the buffer, whose content is then undefined.
    pub fn encode(&self, buffer: &mut [u8]) -> Result<usize, EncodeError> {
        let len = self.encoded_len();
        let mut writer = Writer::new(buffer, len)?;
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
        writer.put(b"\r\n");
        Ok(len)
    }

    /// The length of the reply with its end, in bytes.
    pub fn encoded_len(&self) -> usize {
        match self {
            Self::Ok => 4,
            Self::Error { .. } => 10,
            Self::Status(status) => 18 + status.pose.encoded_len(),
        }
    }

    /// Appends the reply with its end.
    ///
    /// # Errors
    /// A value does not fit its field, or there is no room; nothing is appended.
    #[cfg(feature = "bytes")]
    pub fn append_to(&self, buffer: &mut impl bytes::BufMut) -> Result<(), EncodeError> {
        let mut bytes = [0; 50];
        let needed = self.encode(&mut bytes)?;
        if needed > buffer.remaining_mut() {
            return Err(EncodeError::Buffer { needed, found: buffer.remaining_mut() });
        }
        buffer.put_slice(bytes.get(..needed).unwrap_or_default());
        Ok(())
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

/// Out of line, because most replies are `OK`.
#[cold]
fn read_error(reader: &mut Reader<'_>) -> Result<ErrorCode, DecodeError> {
    match reader.integer()?.into() {
        ErrorCode::None => Err(DecodeError::ErrorZero),
        error => Ok(error),
    }
}
