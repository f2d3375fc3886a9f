//! What a server reads of its stream, for each framing.

mod any;
mod rtu;

use core::fmt::Debug;
use core::ops::Range;

use robot_session::Decoder as Decode;

pub(crate) use any::AnyReceiver;
pub(crate) use rtu::RtuReceiver;

use crate::decoder::Decoder;
use crate::error::DecodeError;
use crate::frame::{Frame, Side};
use crate::framing::{Framing, Tcp};
use crate::registers::Registers;

/// The requests in a stream.
pub trait Receive: Decode<Error = DecodeError> + Debug + Clone {
    /// Of this framing; `own` is the unit that the server is.
    fn new(framing: Framing, own: Option<u8>) -> Self;

    /// The place of the next request.
    fn advance(&mut self) -> Option<Result<Range<usize>, DecodeError>>;

    /// A request that [`advance`](Self::advance) found.
    fn frame(&self, range: Range<usize>) -> Option<Frame<&[u8]>>;

    /// The unit that such a request is for.
    fn unit(&self, request: &Range<usize>) -> Option<u8>;

    /// [`Frame::serve`], of such a request.
    fn serve<R: Registers>(request: &Frame<&[u8]>, registers: &mut R, out: &mut [u8]) -> Option<usize>;

    /// A silence was seen. What is held may go on after it.
    fn pause(&mut self) {
        self.finish();
    }

    /// Whether what is held may be the beginning of a frame, as found at the last [`pause`](Self::pause).
    fn is_partial(&self) -> bool {
        false
    }

    /// What is held is no frame.
    fn lose(&mut self, error: DecodeError);

    /// The bytes that wait.
    fn pending(&self) -> usize;

    /// Whether nothing has come behind the request that was given last, as far as that counts: on a serial line.
    fn was_last(&self) -> bool {
        true
    }

    /// A line has had no silence for so long that the buffer is full: takes what is past, until there is room; gives the place of what
    /// was a request for this server.
    fn next_followed(&mut self) -> Option<Range<usize>> {
        None
    }

    /// [`Decoder::corruption`], which TCP has.
    fn corruption(&self) -> Option<DecodeError> {
        None
    }
}

impl Receive for Decoder<Tcp> {
    fn new(_: Framing, _: Option<u8>) -> Self {
        Self::new(Tcp, Side::Client)
    }

    #[inline(always)] // into the one place that reads
    fn advance(&mut self) -> Option<Result<Range<usize>, DecodeError>> {
        Self::advance(self)
    }

    #[inline(always)]
    fn frame(&self, range: Range<usize>) -> Option<Frame<&[u8]>> {
        Self::frame(self, range)
    }

    #[inline(always)]
    fn unit(&self, request: &Range<usize>) -> Option<u8> {
        self.byte(request.start + 6)
    }

    #[inline(always)]
    fn serve<R: Registers>(request: &Frame<&[u8]>, registers: &mut R, out: &mut [u8]) -> Option<usize> {
        Frame { transaction: Some(request.transaction?), ..*request }.serve(registers, out)
    }

    fn lose(&mut self, _: DecodeError) {
        Decode::clear(self);
    }

    fn pending(&self) -> usize {
        Self::pending(self)
    }

    #[inline]
    fn corruption(&self) -> Option<DecodeError> {
        Self::corruption(self)
    }
}
