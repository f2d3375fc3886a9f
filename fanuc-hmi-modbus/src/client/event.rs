use core::fmt;

use robot_session::{EchoError, Unexpected};

use crate::error::{DecodeError, Mismatch};
use crate::message::Exception;

/// Identifies a request of a client; never reused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(into = "u64"))]
pub struct Ticket {
    pub(super) number: u64,
    /// The slot in which the client stores the request, and then its reply.
    pub(super) slot: u8,
}

impl Ticket {
    /// Returns the number of the request: the first request that a client accepts is 1.
    pub const fn number(self) -> u64 {
        self.number
    }
}

#[cfg(feature = "serde")]
impl From<Ticket> for u64 {
    fn from(ticket: Ticket) -> Self {
        ticket.number
    }
}

/// The events of a client: the first three are outcomes of requests, the others notices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "event", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ClientEvent {
    /// A reply that fits its request, or the exception that refuses it: [`Client::reply`](crate::Client::reply) returns it.
    Replied {
        /// The ticket of the request that has the reply.
        ticket: Ticket,
        /// The unit that replied, also in the reply.
        #[cfg_attr(feature = "serde", serde(skip))]
        unit: u8,
    },
    /// A broadcast was sent; it has no reply.
    Announced {
        /// The ticket of the broadcast request.
        ticket: Ticket,
    },
    /// There is no usable reply.
    Failed {
        /// The ticket of the request without a usable reply.
        ticket: Ticket,
        /// The reason, which also shows whether the request may have been executed.
        #[cfg_attr(feature = "serde", serde(rename = "reason"))]
        failure: Failure,
    },
    /// An unexpected reply was dropped. If it is late by more than [`ClientConfig::settle`](crate::ClientConfig::settle),
    /// that assumption is wrong.
    Stray {
        /// The transaction of the reply; `None` except on TCP.
        #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
        transaction: Option<u16>,
        /// The transaction of the oldest request in flight; `None` without one, and except on TCP. Not part of the serialized
        /// event.
        #[cfg_attr(feature = "serde", serde(skip))]
        expected: Option<u16>,
        /// The unit that sent the reply.
        unit: u8,
        /// The function code of the reply, without the bit that marks an exception.
        function: u8,
        /// The request that the reply belongs to, which has timed out; `None` if it is not known.
        #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
        late: Option<Ticket>,
        /// The reason that the reply is not the awaited one; `None` on TCP.
        #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
        mismatch: Option<Mismatch>,
    },
    /// Bytes that are not a frame.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Corrupt(DecodeError),
    /// On TCP, which does not corrupt data: bytes that do not begin a frame, and no frame after them yet. Reconnect.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    OutOfStep(DecodeError),
    /// Except on TCP: the line returns the bytes sent, and [`ClientConfig::echo`](crate::ClientConfig::echo) is off; or it is
    /// on, and other bytes came back.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Echo(EchoError),
    /// A call violated the contract; nothing has changed.
    Unexpected(Unexpected),
}

impl ClientEvent {
    /// Returns the request whose outcome the event is.
    pub const fn outcome_of(&self) -> Option<Ticket> {
        match self {
            Self::Replied { ticket, .. } | Self::Announced { ticket } | Self::Failed { ticket, .. } => {
                Some(*ticket)
            }
            Self::Stray { .. }
            | Self::Corrupt(_)
            | Self::OutOfStep(_)
            | Self::Echo(_)
            | Self::Unexpected(_) => None,
        }
    }
}

/// One sentence, without the numbers of tickets if there is more specific information.
impl fmt::Display for ClientEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Replied { ticket, unit } => {
                write!(f, "request {} has a reply of unit {unit}", ticket.number)
            }
            Self::Announced { ticket } => write!(f, "request {} was sent as a broadcast", ticket.number),
            Self::Failed { ticket, failure } => write!(f, "request {}: {failure}", ticket.number),
            Self::Stray { transaction, expected, unit, function, late, mismatch } => {
                f.write_str(if late.is_some() { "a late reply" } else { "a reply" })?;
                match (transaction, expected) {
                    (Some(found), Some(expected)) => {
                        write!(f, " with transaction {found}, expected {expected}")?
                    }
                    (Some(found), None) => write!(f, " with transaction {found}, expected none")?,
                    (None, _) => {}
                }
                write!(f, " (unit {unit}, function {function})")?;
                mismatch.map_or(Ok(()), |mismatch| write!(f, ": {mismatch}"))
            }
            Self::Corrupt(error) => write!(f, "corrupt bytes: {error}"),
            Self::OutOfStep(error) => write!(f, "bytes that do not begin a frame: {error}"),
            Self::Echo(error) => error.fmt(f),
            Self::Unexpected(unexpected) => unexpected.fmt(f),
        }
    }
}

/// The reason that a request has no usable reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Failure {
    /// The reply timed out. Whether the request was executed is unknown.
    #[error("no reply before the timeout; if the request writes, it may have been executed")]
    TimedOut,
    /// Only a frame that equals the request has come, on a connection without any other reply: the line may have returned the
    /// request, and whether a device has executed it is unknown.
    #[error(
        "only the request itself came back, and no other reply shows that a device answers: if the line returns what is sent, set \
         echo=true; if the request writes, it may have been executed"
    )]
    Returned,
    /// The connection was lost while the request was in flight. Whether it was executed is unknown.
    #[error("the connection was lost; if the request writes, it may have been executed")]
    Disconnected,
    /// The connection was lost before the request was sent.
    #[error("the connection was lost before the request was sent")]
    NotSent,
    /// The reply with the transaction of the request does not fit it. Whether the request was executed is unknown.
    #[error("the reply does not answer the request: {0}")]
    #[cfg_attr(feature = "serde", serde(rename = "mismatch"))]
    Refused(Mismatch),
    /// The reply with the transaction of the request is malformed. Whether the request was executed is unknown, unless the
    /// reply is an [exception](Self::exception).
    #[error("the reply is malformed: {0}")]
    Malformed(DecodeError),
}

impl Failure {
    /// Returns whether the server may have executed the request, or may still execute it.
    pub const fn is_unknown(self) -> bool {
        !matches!(self, Self::NotSent) && self.exception().is_none()
    }

    /// Returns the exception with which the server refuses the request, if the reply is malformed because its header has
    /// another length.
    pub const fn exception(self) -> Option<Exception> {
        match self {
            Self::Malformed(DecodeError::ExceptionLength { exception, .. }) => Some(exception),
            _ => None,
        }
    }
}

robot_session::counters! {
    /// The counters of a client.
    pub struct ClientStatistics {
        /// Requests that the client accepted.
        pub requests: u64,
        /// Requests with a reply, including exceptions.
        pub replies: u64,
        /// Requests that failed, which are reported as [`ClientEvent::Failed`].
        pub failures: u64,
        /// Replies to no request in flight, which were dropped.
        pub strays: u64,
        /// Runs of corrupt bytes.
        pub corrupt: u64,
    }
}
