//! The requests of a framing that is chosen when the program runs.

use core::ops::Range;

use super::{Receive, RtuReceiver};
use crate::decoder::Decoder;
use crate::error::DecodeError;
use crate::frame::Frame;
use crate::framing::{Framing, Tcp};
use crate::registers::Registers;

/// The one of both.
#[derive(Debug, Clone)]
pub enum AnyReceiver {
    Tcp(Decoder<Tcp>),
    Rtu(RtuReceiver),
}

/// The same of whichever it is.
macro_rules! either {
    ($self:ident, $receiver:ident => $call:expr) => {
        match $self {
            Self::Tcp($receiver) => $call,
            Self::Rtu($receiver) => $call,
        }
    };
}

impl Receive for AnyReceiver {
    fn new(framing: Framing, own: Option<u8>) -> Self {
        match framing {
            Framing::Tcp => Self::Tcp(Receive::new(framing, own)),
            Framing::Rtu { .. } | Framing::RtuOverTcp { .. } => Self::Rtu(Receive::new(framing, own)),
        }
    }

    #[inline]
    fn advance(&mut self) -> Option<Result<Range<usize>, DecodeError>> {
        either!(self, receiver => receiver.advance())
    }

    #[inline]
    fn frame(&self, range: Range<usize>) -> Option<Frame<&[u8]>> {
        either!(self, receiver => receiver.frame(range))
    }

    #[inline]
    fn unit(&self, request: &Range<usize>) -> Option<u8> {
        either!(self, receiver => receiver.unit(request))
    }

    #[inline]
    fn serve<R: Registers>(request: &Frame<&[u8]>, registers: &mut R, out: &mut [u8]) -> Option<usize> {
        request.serve(registers, out)
    }

    fn pause(&mut self) {
        either!(self, receiver => receiver.pause());
    }

    fn is_partial(&self) -> bool {
        either!(self, receiver => receiver.is_partial())
    }

    fn lose(&mut self, error: DecodeError) {
        either!(self, receiver => receiver.lose(error));
    }

    fn pending(&self) -> usize {
        either!(self, receiver => receiver.pending())
    }

    fn was_last(&self) -> bool {
        either!(self, receiver => receiver.was_last())
    }

    fn next_followed(&mut self) -> Option<Range<usize>> {
        either!(self, receiver => receiver.next_followed())
    }

    fn corruption(&self) -> Option<DecodeError> {
        either!(self, receiver => receiver.corruption())
    }
}

impl robot_session::Decoder for AnyReceiver {
    type Frame<'a> = Frame<&'a [u8]>;
    type Error = DecodeError;

    #[inline]
    fn push(&mut self, bytes: &[u8]) -> usize {
        either!(self, receiver => receiver.push(bytes))
    }

    fn next_frame(&mut self) -> Option<Result<Frame<&[u8]>, DecodeError>> {
        either!(self, receiver => receiver.next_frame())
    }

    fn finish(&mut self) {
        either!(self, receiver => receiver.finish());
    }

    fn position(&self) -> u64 {
        either!(self, receiver => receiver.position())
    }

    fn clear(&mut self) {
        either!(self, receiver => receiver.clear());
    }
}
