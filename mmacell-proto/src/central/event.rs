use core::fmt;

use robot_session::Unexpected;

use crate::error::DecodeError;
use crate::message::{Command, ErrorCode, Status};

/// An event at the central controller's end. All but the first and the last are outcomes; each command has exactly
/// one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "event", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum CentralEvent<P> {
    /// A notice: there is a connection, and a command may be requested.
    Connected,
    /// The device has executed the command, or has started it. The outcome of a [`Command::Close`] is
    /// [`CloseReason::Agreed`] instead.
    Done {
        /// The command that was executed or started.
        command: Command<P>,
    },
    /// The device has not executed the command.
    Refused {
        /// The command that was not executed.
        command: Command<P>,
        /// The device's reason; never [`ErrorCode::None`].
        error: ErrorCode,
    },
    /// The reply to a [`Command::Status`].
    Status {
        /// The status as the device reports it.
        status: Status<P>,
        /// The conclusion for the motion that was commanded last.
        motion: Progress,
    },
    /// The caller has aborted the command before it was sent. It was not executed.
    Aborted {
        /// The command that was not sent.
        command: Command<P>,
    },
    /// The connection has ended: close it, unless the reason is [`CloseReason::Disconnected`].
    Closed {
        /// The reason that the connection has ended.
        reason: CloseReason,
        /// The outcome of the command that was not finished.
        unfinished: Unfinished<P>,
    },
    /// A notice: an input that the machine did not expect. It has no effect.
    Unexpected(Unexpected),
}

/// The reason that a connection has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum CloseReason {
    /// The device has agreed to a [`Command::Close`].
    Agreed,
    /// The reply was overdue: the device did not answer in time.
    Timeout,
    /// The caller has aborted a command whose reply was awaited: replies have no number, so the next one could be taken for
    /// another command's.
    Aborted,
    /// The caller reported that the connection is gone.
    Disconnected,
    /// A line that is not a reply of such a device.
    Malformed(DecodeError),
    /// A well-formed reply that was not requested, or that does not fit the command.
    Mismatch,
}

/// The command that was not finished when its connection ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Unfinished<P> {
    /// Every command had its outcome.
    Nothing,
    /// The command was not sent, and so not executed.
    NotSent(Command<P>),
    /// The command was sent; whether it was executed is unknown.
    Unknown(Command<P>),
}

/// The conclusion from a status for the motion that was commanded last on this connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Progress {
    /// The device is at rest, and there is no target to compare with: no motion was commanded, the motion was stopped, or
    /// the command was a [`Command::Reset`] or a relative motion from an unknown pose.
    Still,
    /// The device has accepted a motion and has not been seen moving. It may seem to be at rest: the status may be
    /// older than the motion.
    Starting,
    /// The device is moving towards its target.
    Moving,
    /// The device has accepted a halt, and is still moving.
    Stopping,
    /// The device is at rest within tolerance of its target, with its servo motors on.
    Arrived,
    /// The device is at rest, and the motion has failed.
    Missed(MissReason),
}

/// The way in which a motion has failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum MissReason {
    /// The device is at rest elsewhere than at its target.
    Elsewhere,
    /// The servo motors are off.
    ServoOff,
}

impl fmt::Display for CloseReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Agreed => f.write_str("the device has agreed to close it"),
            Self::Timeout => f.write_str("no reply in time"),
            Self::Aborted => f.write_str("a command was aborted while its reply was awaited"),
            Self::Disconnected => f.write_str("disconnected"),
            Self::Malformed(error) => error.fmt(f),
            Self::Mismatch => f.write_str("a reply that was not asked for, or of another kind"),
        }
    }
}

impl fmt::Display for MissReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Elsewhere => "it is at rest elsewhere",
            Self::ServoOff => "its servo motors are off",
        })
    }
}
