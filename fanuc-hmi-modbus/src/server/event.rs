use robot_session::Unexpected;

use crate::error::DecodeError;
use crate::message::Exception;

/// What a server reports, for a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ServerEvent {
    /// A request was carried out, or refused with an exception.
    Served {
        /// The transaction on TCP.
        transaction: Option<u16>,
        /// The unit; 0 is a broadcast where [`ServerConfig::broadcast`](crate::ServerConfig::broadcast) is on.
        unit: u8,
        /// The function code.
        function: u8,
        /// Why it was refused.
        exception: Option<Exception>,
    },
    /// On a serial line: a request was neither carried out nor answered, because too many replies wait.
    Refused {
        /// The unit.
        unit: u8,
        /// The function code.
        function: u8,
    },
    /// Bytes that are no frame.
    Corrupt(DecodeError),
    /// On TCP, which corrupts nothing: bytes that no frame begins with, and no frame after them yet. Best close the connection.
    OutOfStep(DecodeError),
    /// The caller broke the contract; nothing has changed.
    Unexpected(Unexpected),
}

/// The counters of a server.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct ServerStatistics {
    /// Requests that were carried out, or refused with an exception.
    pub served: u64,
    /// On a serial line: requests that were neither carried out nor answered, because too many replies waited.
    pub refused: u64,
    /// Runs of corrupt bytes.
    pub corrupt: u64,
    /// Inputs that the machine did not expect: the caller broke the contract.
    pub unexpected: u64,
    /// Notices that nobody polled in time.
    pub dropped_notices: u64,
}
