use robot_session::Encode;

use super::in_dialect::InDialect;
use crate::dialect::Dialect;
use crate::error::{DecodeError, EncodeError, Expected};
use crate::fields::{Reader, Writer, end_len, integer_len};
use crate::frame::Line;
use crate::pose::Pose;

/// The gripper whose "open" turns the vacuum on (§4.10).
pub const VACUUM: i32 = 0;
/// The gripper whose "open" turns the blow on (§4.10).
pub const BLOW: i32 = 1;

/// A command to a device whose axes are `P` (§4).
///
/// The pick-and-place motion of §4.5 is not among them: its command was never defined.
///
/// | on the wire | length with its end |
/// | --- | --- |
/// | `STA` | 5 |
/// | `SRVON`, `SRVOF` | 7 |
/// | `OVR+00050` | 11 |
/// | `MOVA+010.000-002.000+005.999-01.2322` (robot) | 38 |
/// | `MOVR-00.0100+00.0250` (platform) | 22 |
/// | `STP`, `RST`, `CLO` | 5 |
/// | `ACQ+00001` | 11 |
/// | `HND+00000OPEN`, `HND+00000CLOSE` | 15, 16 |
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "command"))]
#[non_exhaustive]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum Command<P> {
    /// `STA`: report the status (§4.1).
    #[cfg_attr(feature = "serde", serde(rename = "STA"))]
    Status,
    /// `SRV`: servo motors on or off (§4.2).
    #[cfg_attr(feature = "serde", serde(rename = "SRV"))]
    Servo {
        /// Whether the motors are switched on.
        on: bool,
    },
    /// `OVR`: set the override, the speed of all motions (§4.3).
    #[cfg_attr(feature = "serde", serde(rename = "OVR"))]
    Override {
        /// The speed of all motions, 0 to 100 %.
        #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::percent))]
        percent: u8,
    },
    /// `MOV`: start a point-to-point motion (§4.4). The reply means that it has started, not that it has ended.
    #[cfg_attr(feature = "serde", serde(rename = "MOV"))]
    Move {
        /// Whether the pose is a target or a distance.
        mode: Mode,
        /// The target or the distance, by `mode`.
        #[cfg_attr(feature = "serde", serde(rename = "axes"))]
        pose: P,
    },
    /// `STP`: stop the motion (§4.6).
    #[cfg_attr(feature = "serde", serde(rename = "STP"))]
    Stop,
    /// `RST`: bring the device into a safe state, at home (§4.7).
    #[cfg_attr(feature = "serde", serde(rename = "RST"))]
    Reset,
    /// `CLO`: the connection will be closed (§4.8).
    #[cfg_attr(feature = "serde", serde(rename = "CLO"))]
    Close,
    /// `ACQ`: take a picture; only for a vision system with a controller of its own (§4.9).
    #[cfg_attr(feature = "serde", serde(rename = "ACQ"))]
    Acquire {
        /// The number of the camera; 16 bits on the wire.
        #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::integer))]
        camera: i32,
    },
    /// `HND`: open or close a gripper; only for a gripper with a controller of its own (§4.10).
    #[cfg_attr(feature = "serde", serde(rename = "HND"))]
    Grip {
        /// The number of the gripper: [`VACUUM`], [`BLOW`] or another; 16 bits on the wire.
        #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::integer))]
        gripper: i32,
        /// Whether the gripper is opened: for [`VACUUM`] and [`BLOW`] this turns the air on.
        open: bool,
    },
}

/// Whether a pose is a target or a distance (§4.4).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum Mode {
    /// `A`: a motion to this pose.
    Absolute,
    /// `R`: a relative motion by this distance.
    Relative,
}

impl<P: Pose> Command<P> {
    /// The longest command with its end, in any dialect, in bytes.
    pub const MAX_LEN: usize = 38;

    /// Decodes the command in a line.
    ///
    /// # Errors
    /// The line is not a command of such a device.
    pub fn decode(line: Line<'_>, dialect: &Dialect) -> Result<Self, DecodeError> {
        let mut reader = Reader::new(line.content(), dialect);
        let command = match reader.take::<3>(Expected::Command)? {
            b"STA" => Self::Status,
            b"SRV" => Self::Servo { on: read_servo(&mut reader)? },
            b"OVR" => Self::Override { percent: read_override(&mut reader)? },
            b"MOV" => Self::Move { mode: read_mode(&mut reader)?, pose: P::read(&mut reader)? },
            b"STP" => Self::Stop,
            b"ITR" if dialect.itr => Self::Stop,
            b"RST" => Self::Reset,
            b"CLO" => Self::Close,
            b"ACQ" => Self::Acquire { camera: reader.integer()? },
            b"HND" => Self::Grip { gripper: reader.integer()?, open: read_open(&mut reader)? },
            found => return Err(DecodeError::UnknownCommand { found: *found }),
        };
        reader.end()?;
        Ok(command)
    }

    /// Returns the command in the form of a dialect: with each of the dialect's readings in place of the source's own.
    pub const fn in_dialect(self, dialect: Dialect) -> InDialect<Self> {
        InDialect { message: self, dialect }
    }

    /// Appends the command with its end, as the source defines it.
    ///
    /// # Errors
    /// A value does not fit its field, or the message does not fit the buffer; nothing is appended.
    #[cfg(feature = "bytes")]
    pub fn append_to(&self, buffer: &mut impl bytes::BufMut) -> Result<(), EncodeError> {
        self.in_dialect(Dialect::STRICT).append_to(buffer)
    }

    /// Returns whether the command contains numbers; a command without numbers has a form in every dialect.
    pub(crate) const fn has_values(&self) -> bool {
        !matches!(self, Self::Status | Self::Servo { .. } | Self::Stop | Self::Reset | Self::Close)
    }

    pub(super) fn len_in(&self, dialect: &Dialect) -> usize {
        let content = match self {
            Self::Status | Self::Stop | Self::Reset | Self::Close => 3,
            Self::Servo { on: true } => 5,
            Self::Servo { on: false } => 5 + usize::from(dialect.off),
            Self::Override { .. } => 3 + usize::from(dialect.ovrd) + integer_len(dialect),
            Self::Acquire { .. } => 3 + integer_len(dialect),
            Self::Move { pose, .. } => 4 + pose.encoded_len(),
            Self::Grip { open: true, .. } => 7 + integer_len(dialect),
            Self::Grip { open: false, .. } => 8 - usize::from(dialect.clos) + integer_len(dialect),
        };
        content + end_len(dialect)
    }

    pub(super) fn write(&self, dialect: &Dialect, buffer: &mut [u8]) -> Result<usize, EncodeError> {
        let len = self.len_in(dialect);
        let mut writer = Writer::new(buffer, len, dialect)?;
        match self {
            Self::Status => writer.put(b"STA"),
            Self::Servo { on: true } => writer.put(b"SRVON"),
            Self::Servo { on: false } if dialect.off => writer.put(b"SRVOFF"),
            Self::Servo { on: false } => writer.put(b"SRVOF"),
            Self::Override { percent } => {
                writer.put(b"OVR");
                if dialect.ovrd {
                    writer.put(b"D");
                }
                writer.percent(*percent)?;
            }
            Self::Move { mode, pose } => {
                writer.put(match mode {
                    Mode::Absolute => b"MOVA",
                    Mode::Relative => b"MOVR",
                });
                pose.write(&mut writer)?;
            }
            Self::Stop if dialect.itr => writer.put(b"ITR"),
            Self::Stop => writer.put(b"STP"),
            Self::Reset => writer.put(b"RST"),
            Self::Close => writer.put(b"CLO"),
            Self::Acquire { camera } => {
                writer.put(b"ACQ");
                writer.integer(*camera)?;
            }
            Self::Grip { gripper, open } => {
                writer.put(b"HND");
                writer.integer(*gripper)?;
                match open {
                    true => writer.put(b"OPEN"),
                    false if dialect.clos => writer.put(b"CLOS"),
                    false => writer.put(b"CLOSE"),
                }
            }
        }
        writer.end();
        Ok(len)
    }
}

/// As the source defines it.
impl<P: Pose> Encode for Command<P> {
    type Error = EncodeError;

    fn encoded_len(&self) -> usize {
        self.len_in(&Dialect::STRICT)
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        self.write(&Dialect::STRICT, out)
    }
}

fn read_servo(reader: &mut Reader<'_>) -> Result<bool, DecodeError> {
    let off: &[u8] = if reader.dialect().off { b"OFF" } else { b"OF" };
    reader.word(&[(b"ON", true), (b"OF", false), (off, false)], Expected::OnOrOff)
}

fn read_override(reader: &mut Reader<'_>) -> Result<u8, DecodeError> {
    if reader.dialect().ovrd && reader.rest().starts_with(b"D") {
        reader.take::<1>(Expected::Sign)?;
    }
    reader.percent()
}

fn read_mode(reader: &mut Reader<'_>) -> Result<Mode, DecodeError> {
    let offset = reader.offset();
    match reader.take(Expected::AbsoluteOrRelative)? {
        b"A" => Ok(Mode::Absolute),
        b"R" => Ok(Mode::Relative),
        &[found] => Err(DecodeError::Unexpected { offset, found, expected: Expected::AbsoluteOrRelative }),
    }
}

fn read_open(reader: &mut Reader<'_>) -> Result<bool, DecodeError> {
    let close: &[u8] = if reader.dialect().clos { b"CLOS" } else { b"CLOSE" };
    reader.word(&[(b"OPEN", true), (b"CLOSE", false), (close, false)], Expected::OpenOrClose)
}
