use core::time::Duration;

use crate::framing::Framing;
#[cfg(feature = "rtu")]
use crate::{frame::Frame, timing};

/// Settings of a client.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClientConfig {
    /// The transport, and the separation of frames on it. [`Framing::Tcp`].
    pub framing: Framing,
    /// The timeout from the transmission of a request to its reply; above zero. One second. On a serial line
    /// [`rtu`](Self::rtu) adds the time that the longest request and the longest reply take.
    pub timeout: Duration,
    /// The maximum number of requests in flight, 1 to the client's slots. 1, which every server supports: how many a FANUC
    /// controller supports is not published. Without transactions in the frames, more than 1 is invalid.
    pub in_flight: usize,
    /// Whether a reply from another unit is accepted, which some gateways send. Off.
    pub any_unit: bool,
    /// Whether unit 0 is a broadcast, which has no reply. On for RTU; off on TCP, where 0 is often the server itself.
    pub broadcast: bool,
    /// The time for the units of a serial line to execute a broadcast, from its transmission. 100 ms, to which
    /// [`rtu`](Self::rtu) adds the time of the longest frame.
    pub turnaround: Duration,
    /// An assumption: the latest reply after its request has timed out. Without a transaction, a late reply could be taken
    /// for the reply to the next request, which therefore waits this long. Not used on TCP. If a reply is later still, it may
    /// be matched to the wrong request, whose own reply is then reported as a stray. 1 s on a serial line; 10 s for RTU over
    /// TCP, where a new connection ends the wait at once.
    pub settle: Duration,
    /// The time after the end of a request in which nothing is sent, for devices that lose bytes that come sooner. 0.
    pub pause: Duration,
    /// Whether the line returns the bytes sent, as adapters for two wires often do; not on TCP. Off. The bytes of a request
    /// then come back first: they are compared with it and dropped, and others are
    /// [`ClientEvent::Echo`](crate::ClientEvent::Echo), a collision.
    ///
    /// While it is off, requests on a connection that cannot equal their reply show whether the line returns them; that is
    /// the same event, and from then on the returned bytes are dropped.
    ///
    /// On or off, a reply that equals its request (function 5, 6, 8 or 22, or one without a type) counts only if another
    /// reply has come on the connection, which the line cannot have returned: otherwise it may be the request itself, and
    /// the outcome is [`Failure::Returned`](crate::Failure::Returned). So before such a request the client reads register 0
    /// of its unit, until one of these reads or another request has a reply.
    pub echo: bool,
    /// For the model only: transactions count modulo this.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub transactions: u16,
    /// The rules of the machine that are in force: all of them by default.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub rules: robot_session::end::Rules<Rule>,
}

robot_session::rules! {
    /// The rules of the client's machine.
    pub enum Rule for ClientConfig {
        /// A reply belongs to the request with its transaction.
        MatchTransaction,
        /// No transaction is used again while a reply to it may come.
        FreshTransaction,
        /// Without transactions one request is in flight at once.
        OneInFlight,
        /// A reply must fit its request.
        CheckReply,
        /// Without transactions an exception after corrupt bytes may be data of the damaged reply.
        DoubtException,
        /// On a serial line a request of another client may be in flight at the beginning.
        DrainFirst,
        /// Nothing is sent before the bytes that have arrived were read.
        ReadBeforeSend,
        /// On a serial line nothing is sent while bytes arrive.
        WaitForSilence,
        /// Bytes after a silence do not continue an earlier frame.
        CutAtSilence,
        /// The rest of a reply that has begun is waited for, even if a silence is seen within it.
        AwaitRest,
        /// Without transactions no request that can equal its reply is sent before a read that shows that a device answers on
        /// the line.
        ProveEcho,
        /// A frame that equals its request is not a reply on a line on which no other reply has come.
        ProveReply,
        /// Requests in flight end with the connection.
        EndAtDisconnect,
        /// Requests that wait to be sent end with the connection.
        DropQueued,
    }
}

impl ClientConfig {
    /// Modbus TCP.
    #[cfg(feature = "tcp")]
    pub const fn tcp() -> Self {
        Self::of(Framing::Tcp)
    }

    const fn of(framing: Framing) -> Self {
        Self {
            framing,
            timeout: Duration::from_secs(1),
            in_flight: 1,
            any_unit: false,
            broadcast: false,
            turnaround: Duration::from_millis(100),
            settle: Duration::from_secs(1),
            pause: Duration::ZERO,
            echo: false,
            #[cfg(feature = "model")]
            transactions: u16::MAX,
            #[cfg(feature = "model")]
            rules: robot_session::end::Rules::ALL,
        }
    }

    /// Returns the configuration of RTU on a serial line.
    #[cfg(feature = "rtu")]
    pub const fn rtu(baud: u32) -> Self {
        let config = Self::of(Framing::Rtu { silence: timing::silence(baud) });
        let longest = timing::transmission_time(Frame::MAX_RTU_LEN, baud);
        Self {
            timeout: config.timeout.saturating_add(longest).saturating_add(longest),
            turnaround: config.turnaround.saturating_add(longest),
            broadcast: true,
            ..config
        }
    }

    /// Returns the configuration of RTU frames over TCP.
    #[cfg(feature = "rtu")]
    pub const fn rtu_over_tcp() -> Self {
        let settle = Duration::from_secs(10);
        Self { broadcast: true, settle, ..Self::of(Framing::RTU_OVER_TCP) }
    }

    /// Returns whether a request to this unit is a broadcast.
    pub const fn is_broadcast(&self, unit: u8) -> bool {
        self.broadcast && unit == 0
    }

    /// Returns the maximum number of requests in flight at once.
    pub(crate) fn most_in_flight(&self) -> usize {
        match self.framing.has_transactions() || !self.keeps(Rule::OneInFlight) {
            true => self.in_flight,
            false => 1,
        }
    }

    /// Returns the transaction after this one.
    pub(crate) const fn after(&self, transaction: u16) -> u16 {
        #[cfg(feature = "model")]
        if transaction >= self.transactions {
            return 0;
        }
        transaction.wrapping_add(1)
    }
}

#[cfg(feature = "tcp")]
impl Default for ClientConfig {
    fn default() -> Self {
        Self::tcp()
    }
}
