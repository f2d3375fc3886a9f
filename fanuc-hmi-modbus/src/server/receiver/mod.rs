//! The requests in a server's stream.

#[cfg(feature = "rtu")]
mod rtu;

use core::ops::Range;

use robot_session::Decoder as Decode;

use crate::error::DecodeError;
use crate::frame::Frame;
use crate::framing::Framing;
use crate::server::ServerConfig;
#[cfg(feature = "tcp")]
use crate::{decoder::Decoder, frame::Side};
#[cfg(feature = "rtu")]
use rtu::RtuReceiver;

/// The receiver of a server. A TCP server reads like any decoder; on a line there are other units.
#[derive(Debug, Clone)]
#[cfg_attr(
    all(feature = "rtu", feature = "tcp"),
    expect(clippy::large_enum_variant, reason = "nothing is allocated, and boards have one framing")
)]
pub enum Receiver {
    #[cfg(feature = "tcp")]
    Tcp(Decoder),
    #[cfg(feature = "rtu")]
    Rtu(RtuReceiver),
}

/// Defines a call, or a value, for each receiver.
macro_rules! each {
    ($receiver:expr, $tcp:ident => $of_tcp:expr, $rtu:ident => $of_rtu:expr) => {
        match $receiver {
            #[cfg(feature = "tcp")]
            Receiver::Tcp($tcp) => $of_tcp,
            #[cfg(feature = "rtu")]
            Receiver::Rtu($rtu) => $of_rtu,
        }
    };
    ($receiver:expr, $it:ident => $call:expr) => {
        each!($receiver, $it => $call, $it => $call)
    };
}

impl Receiver {
    pub(crate) fn new(config: &ServerConfig) -> Self {
        match config.framing {
            #[cfg(feature = "tcp")]
            framing @ Framing::Tcp => Self::Tcp(Decoder::new(framing, Side::Client)),
            #[cfg(feature = "rtu")]
            framing @ (Framing::Rtu { .. } | Framing::RtuOverTcp { .. }) => {
                Self::Rtu(RtuReceiver::new(framing, config.unit))
            }
        }
    }

    /// Returns the range of the next request.
    #[inline]
    pub(crate) fn advance(&mut self) -> Option<Result<Range<usize>, DecodeError>> {
        each!(self, it => it.advance())
    }

    /// Returns a request that [`advance`](Self::advance) found.
    #[inline]
    pub(crate) fn frame(&self, range: Range<usize>) -> Option<Frame<&[u8]>> {
        each!(self, it => it.frame(range))
    }

    /// Returns the unit that such a request is for.
    #[inline]
    pub(crate) fn unit(&self, request: &Range<usize>) -> Option<u8> {
        self.frame(request.clone()).map(|frame| frame.unit)
    }

    /// Records a silence. The held bytes may continue after it.
    pub(crate) fn pause(&mut self) {
        each!(self, tcp => tcp.finish(), rtu => rtu.pause());
    }

    /// Returns whether the held bytes may be the beginning of a frame, as found at the last [`pause`](Self::pause).
    pub(crate) fn is_partial(&self) -> bool {
        each!(self, _tcp => false, rtu => rtu.is_partial())
    }

    /// Drops the waiting bytes; returns them as noise.
    pub(crate) fn lose(&mut self) -> DecodeError {
        let noise = DecodeError::Noise { length: each!(self, it => it.pending()) };
        each!(self, tcp => tcp.clear(), rtu => rtu.lose(noise));
        noise
    }

    /// Returns whether nothing has come after the last returned request, as far as that counts: on a serial line.
    #[inline]
    pub(crate) fn was_last(&self) -> bool {
        each!(self, _tcp => true, rtu => rtu.was_last())
    }

    /// Handles a line without a silence for so long that the buffer is full: takes the past bytes, until there is free space;
    /// returns the range of a request for this server among them.
    pub(crate) fn next_followed(&mut self) -> Option<Range<usize>> {
        each!(self, _tcp => None, rtu => rtu.next_followed())
    }

    /// Returns the corruption that a TCP stream is in.
    #[inline]
    pub(crate) fn corruption(&self) -> Option<DecodeError> {
        each!(self, tcp => tcp.corruption(), _rtu => None)
    }
}

impl Decode for Receiver {
    type Frame<'a> = Frame<&'a [u8]>;
    type Error = DecodeError;

    #[inline]
    fn push(&mut self, bytes: &[u8]) -> usize {
        each!(self, it => it.push(bytes))
    }

    fn next_frame(&mut self) -> Option<Result<Frame<&[u8]>, DecodeError>> {
        each!(self, it => it.next_frame())
    }

    fn finish(&mut self) {
        each!(self, it => it.finish());
    }

    fn position(&self) -> u64 {
        each!(self, it => it.position())
    }

    fn clear(&mut self) {
        each!(self, it => it.clear());
    }
}
