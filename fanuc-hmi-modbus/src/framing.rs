use core::time::Duration;

/// The separation of frames on the transport. A build without the feature `rtu` or `tcp` has none of its variants, and links
/// none of its code.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Framing {
    /// Modbus TCP: MBAP headers.
    #[cfg(feature = "tcp")]
    Tcp,
    /// RTU on a serial line: unit and CRC, and a silence between frames.
    #[cfg(feature = "rtu")]
    Rtu {
        /// The silence of the line between two frames: see [`timing::silence`](crate::timing::silence). Add the delay of the
        /// driver: a USB adapter up to 16 ms.
        silence: Duration,
    },
    /// RTU frames through a TCP connection ("RTU over TCP"), where a gap shows nothing of the line beyond it.
    #[cfg(feature = "rtu")]
    RtuOverTcp {
        /// The silence after which a client gives up an incomplete reply, and a server reads on after bytes that are not a frame.
        /// Longer than any delay of the network.
        stall: Duration,
    },
}

#[cfg(not(any(feature = "rtu", feature = "tcp")))]
compile_error!("no framing: fanuc-hmi-modbus needs its feature `tcp` or `rtu`, which are on by default");

impl Framing {
    /// RTU over TCP that waits half a second for the rest of a frame.
    #[cfg(feature = "rtu")]
    pub const RTU_OVER_TCP: Self = Self::RtuOverTcp { stall: Duration::from_millis(500) };

    /// Returns the time without bytes after which a frame counts as ended; TCP frames have their length.
    pub const fn silence(self) -> Option<Duration> {
        match self {
            #[cfg(feature = "tcp")]
            Self::Tcp => None,
            #[cfg(feature = "rtu")]
            Self::Rtu { silence } => Some(silence),
            #[cfg(feature = "rtu")]
            Self::RtuOverTcp { stall } => Some(stall),
        }
    }

    /// Returns true for a serial line, on which a silence separates frames.
    pub(crate) const fn is_serial(self) -> bool {
        match self {
            #[cfg(feature = "tcp")]
            Self::Tcp => false,
            #[cfg(feature = "rtu")]
            Self::Rtu { .. } => true,
            #[cfg(feature = "rtu")]
            Self::RtuOverTcp { .. } => false,
        }
    }

    /// Returns true if frames have a transaction identifier.
    pub(crate) const fn has_transactions(self) -> bool {
        match self {
            #[cfg(feature = "tcp")]
            Self::Tcp => true,
            #[cfg(feature = "rtu")]
            Self::Rtu { .. } | Self::RtuOverTcp { .. } => false,
        }
    }
}
