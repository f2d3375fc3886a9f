use core::time::Duration;

use crate::framing::Framing;
#[cfg(feature = "rtu")]
use crate::timing;

/// Settings of a server.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ServerConfig {
    /// The transport, and the separation of frames on it. [`Framing::Tcp`].
    pub framing: Framing,
    /// The unit number of the server, 1 to 247 (also 0 and 255 on TCP): requests to other units are not executed. `None`, the
    /// default, answers every unit with its own identifier, as most Modbus TCP servers do.
    pub unit: Option<u8>,
    /// Whether unit 0 is a broadcast, executed without a reply. Off on TCP, where 0 is often the server itself; on for RTU.
    pub broadcast: bool,
    /// On a serial line, the time from the last byte of an incomplete request until it is given up. Bytes of one request
    /// arrive in pieces: a CH340 delivers 32 at once, an FTDI adapter up to 16 ms late, a UART with a FIFO 8 or 14.
    /// [`rtu`](Self::rtu) sets the time of 32 characters and 20 ms.
    pub frame_timeout: Duration,
    /// Whether the line returns the bytes sent, as adapters for two wires often do; not on TCP. Off. The bytes of a reply
    /// then come back first: they are compared with it and dropped, and others are
    /// [`ServerEvent::Echo`](crate::ServerEvent::Echo), a collision.
    ///
    /// While it is off, such a line returns the reply to a write to the server as the same write, again and again. The first
    /// reply to a read that is longer than a request shows it: that is the same event, and from then on the returned bytes
    /// are dropped.
    pub echo: bool,
    /// The rules of the machine that are in force: all of them by default.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub rules: robot_session::end::Rules<Rule>,
}

robot_session::rules! {
    /// The rules of the server's machine.
    pub enum Rule for ServerConfig {
        /// Only requests for the server's own unit are executed.
        CheckUnit,
        /// A broadcast is not answered.
        NoReplyToBroadcast,
        /// On a serial line nothing is sent while bytes arrive.
        ReplyAfterSilence,
        /// On a serial line a request that is followed by another frame is not answered: its client has given up.
        AnswerLast,
        /// The rest of a frame that has begun is awaited, even if a silence is seen within it.
        AwaitRest,
        /// Replies end with the connection.
        DropReplies,
        /// Over TCP a request is read when there is a free entry for its reply.
        WaitForPlace,
    }
}

impl ServerConfig {
    /// Modbus TCP: every unit is answered.
    #[cfg(feature = "tcp")]
    pub const fn tcp() -> Self {
        Self::of(Framing::Tcp, None)
    }

    /// Returns the configuration of RTU on a serial line.
    #[cfg(feature = "rtu")]
    pub const fn rtu(unit: u8, baud: u32) -> Self {
        let framing = Framing::Rtu { silence: timing::silence(baud) };
        let piece = timing::transmission_time(32, baud);
        Self {
            frame_timeout: piece.saturating_add(Duration::from_millis(20)),
            ..Self::of(framing, Some(unit))
        }
    }

    /// Returns the configuration of RTU frames over TCP.
    #[cfg(feature = "rtu")]
    pub const fn rtu_over_tcp(unit: u8) -> Self {
        Self::of(Framing::RTU_OVER_TCP, Some(unit))
    }

    const fn of(framing: Framing, unit: Option<u8>) -> Self {
        Self {
            framing,
            unit,
            broadcast: !framing.has_transactions(),
            frame_timeout: Duration::from_millis(50),
            echo: false,
            #[cfg(feature = "model")]
            rules: robot_session::end::Rules::ALL,
        }
    }

    /// Returns whether a request to this unit is a broadcast.
    pub const fn is_broadcast(&self, unit: u8) -> bool {
        self.broadcast && unit == 0
    }
}

#[cfg(feature = "tcp")]
impl Default for ServerConfig {
    fn default() -> Self {
        Self::tcp()
    }
}
