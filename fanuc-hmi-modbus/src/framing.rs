use core::time::Duration;

/// How frames follow one another on the transport.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Framing {
    /// Modbus TCP: MBAP headers.
    Tcp,
    /// RTU on a serial line: unit and CRC, and a silence between frames.
    Rtu {
        /// How long the line is silent between two frames: see [`timing::silence`](crate::timing::silence). Add what the driver delivers
        /// late: a USB adapter up to 16 ms.
        silence: Duration,
    },
    /// RTU frames through a TCP connection ("RTU over TCP"), where a gap shows nothing of the line beyond it.
    RtuOverTcp {
        /// The silence after which a client gives up an incomplete reply, and a server reads on after bytes that are not a frame.
        /// Longer than any delay of the network.
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

/// Modbus TCP and nothing else: a `Decoder<Tcp>`, a `Client<8, Tcp>` or a `Server<R, 8, Tcp>` links no CRC.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Tcp;

/// RTU and nothing else, on a serial line or over TCP: what is made for it links no MBAP header.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Rtu;

/// The framings that a decoder or a session is built for: [`Framing`], all of them; or [`Tcp`] or [`Rtu`] alone.
pub trait Framings: Copy + sealed::Framings + 'static {}

impl<F: Copy + sealed::Framings + 'static> Framings for F {}

pub(crate) mod sealed {
    use super::{Framing, Rtu, Tcp};
    use crate::decoder::{Decoder, Ends, RtuEnds};
    use crate::server::{AnyReceiver, Receive, RtuReceiver};

    pub trait Framings: Sized {
        /// What a server reads with.
        type Receiver: Receive;

        /// What a decoder knows of the frames within corruption.
        type Ends: Ends;

        /// This framing, if it is among them.
        fn of(framing: Framing) -> Option<Self>;

        /// [`Framing::has_transactions`].
        fn has_transactions(self) -> bool;
    }

    impl Framings for Framing {
        type Receiver = AnyReceiver;
        type Ends = RtuEnds;

        fn of(framing: Framing) -> Option<Self> {
            Some(framing)
        }

        #[inline(always)]
        fn has_transactions(self) -> bool {
            self.has_transactions()
        }
    }

    impl Framings for Tcp {
        type Receiver = Decoder<Tcp>;
        type Ends = ();

        fn of(framing: Framing) -> Option<Self> {
            framing.has_transactions().then_some(Self)
        }

        #[inline(always)] // where this is known, the other framings are left out
        fn has_transactions(self) -> bool {
            true
        }
    }

    impl Framings for Rtu {
        type Receiver = RtuReceiver;
        type Ends = RtuEnds;

        fn of(framing: Framing) -> Option<Self> {
            (!framing.has_transactions()).then_some(Self)
        }

        #[inline(always)]
        fn has_transactions(self) -> bool {
            false
        }
    }
}
