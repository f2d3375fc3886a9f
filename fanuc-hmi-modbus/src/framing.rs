use core::time::Duration;

/// How frames follow one another on the transport.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Framing {
    /// Modbus TCP: MBAP headers.
    Tcp,
    /// RTU on a serial line: unit and CRC, and a silence between frames.
    Rtu {
        /// How long the line is silent between two frames: see [`timing::silence`](crate::timing::silence).
        silence: Duration,
    },
    /// RTU frames through a TCP connection ("RTU over TCP"), where a gap shows nothing of the line beyond it.
    RtuOverTcp {
        /// After how long without a byte a frame that is not whole counts as cut. Longer than any delay of the network.
        stall: Duration,
    },
}

impl Framing {
    /// RTU over TCP that waits half a second for the rest of a frame.
    pub const RTU_OVER_TCP: Self = Self::RtuOverTcp { stall: Duration::from_millis(500) };

    /// How long nothing must arrive for a frame to count as ended; TCP frames have their length.
    pub const fn silence(self) -> Option<Duration> {
        match self {
            Self::Tcp => None,
            Self::Rtu { silence } => Some(silence),
            Self::RtuOverTcp { stall } => Some(stall),
        }
    }

    /// True for a serial line, on which a silence separates frames.
    pub(crate) const fn is_serial(self) -> bool {
        matches!(self, Self::Rtu { .. })
    }

    /// True where frames carry a transaction identifier.
    pub(crate) const fn has_transactions(self) -> bool {
        matches!(self, Self::Tcp)
    }
}
