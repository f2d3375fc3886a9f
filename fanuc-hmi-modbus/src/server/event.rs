use robot_session::{EchoError, Unexpected};

use crate::error::DecodeError;
use crate::message::Exception;

/// An event of a server, for a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "event", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ServerEvent {
    /// A request was executed, or refused with an exception.
    Served {
        /// The transaction of the request; `None` except on TCP.
        #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
        transaction: Option<u16>,
        /// The unit; 0 is a broadcast if [`ServerConfig::broadcast`](crate::ServerConfig::broadcast) is on.
        unit: u8,
        /// The function code of the request.
        function: u8,
        /// The reason of the refusal; `None`: executed.
        #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
        exception: Option<Exception>,
    },
    /// On a serial line: a request was neither executed nor answered, because another frame has followed it without a
    /// silence, or too many replies wait.
    Refused {
        /// The unit that the request is for.
        unit: u8,
        /// The function code of the request.
        function: u8,
    },
    /// Bytes that are not a frame.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Corrupt(DecodeError),
    /// On TCP, which corrupts nothing: bytes that do not begin a frame, and no frame after them yet. Best close the
    /// connection.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    OutOfStep(DecodeError),
    /// Except on TCP: the line returns the bytes sent, and [`ServerConfig::echo`](crate::ServerConfig::echo) is off; or it is
    /// on, and other bytes came back.
    #[cfg_attr(feature = "serde", serde(serialize_with = "robot_session::under::error"))]
    Echo(EchoError),
    /// A call violated the contract; nothing has changed.
    Unexpected(Unexpected),
}

robot_session::counters! {
    /// The counters of a server.
    pub struct ServerStatistics {
        /// Requests that were executed, or refused with an exception.
        pub served: u64,
        /// On a serial line: requests that were neither executed nor answered, see [`ServerEvent::Refused`].
        pub refused: u64,
        /// Runs of corrupt bytes.
        pub corrupt: u64,
    }
}
