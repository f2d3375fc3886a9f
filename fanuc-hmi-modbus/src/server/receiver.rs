//! What a server reads of its stream.

use core::ops::Range;

use robot_session::Decoder as _;

use crate::decoder::{self, Decoder};
use crate::error::DecodeError;
use crate::frame::{Frame, RtuLen, Side};
use crate::framing::{Framing, Framings};

/// The requests in a stream. Over TCP a [`Decoder`].
///
/// RTU frames may come from other units as well, on a line that damages them, and any data may look like a request. So a frame begins
/// where the input has begun, or behind a whole frame of either direction, and nowhere else; behind what is no frame nothing is read
/// until the input ends. Through TCP, which loses nothing, the rest of a frame may come after any stall. On a serial line, where the silence ends a message, it is read when it has ended, and is whole frames or nothing.
#[derive(Debug, Clone)]
pub struct Receiver<F> {
    decoder: Decoder<F>,
    /// The unit whose requests are read; everything else on the line may as well be a reply.
    own: Option<u8>,
    is_serial: bool,
    /// What is held up to its end is whole frames.
    is_whole: bool,
    /// What there is until the end is no frame.
    lost: Option<DecodeError>,
}

/// What begins with some bytes.
enum Begun {
    /// A frame of so many bytes.
    Frame(usize, Side),
    /// More bytes have to come.
    Part,
}

/// What is kept of a line without a silence: a frame may have begun in it.
const KEPT: usize = Frame::MAX_RTU_LEN;

impl<F: Framings> Receiver<F> {
    pub(super) const fn new(framing: F, config: Framing, own: Option<u8>) -> Self {
        let decoder = Decoder::new(framing, Side::Client);
        Self { decoder, own, is_serial: config.is_serial(), is_whole: false, lost: None }
    }

    /// The place of the next request.
    #[inline(always)] // into the one place that reads
    pub(super) fn advance(&mut self) -> Option<Result<Range<usize>, DecodeError>> {
        if self.decoder.has_transactions() { self.decoder.advance() } else { self.advance_rtu() }
    }

    #[inline(never)]
    fn advance_rtu(&mut self) -> Option<Result<Range<usize>, DecodeError>> {
        loop {
            let (held, has_ended) = self.decoder.held();
            let length = held.len();
            if self.lost.is_none() && length > 0 {
                if has_ended && self.is_serial && !self.is_whole {
                    self.lost = no_frames(held, self.own);
                    self.is_whole = self.lost.is_none();
                }
                match begun(held, self.own, has_ended, !self.is_serial) {
                    _ if self.lost.is_some() => {}
                    Ok(Begun::Frame(length, side)) => {
                        let range = self.decoder.take(length);
                        match side {
                            Side::Client => return Some(Ok(range)),
                            Side::Server => continue,
                        }
                    }
                    Ok(Begun::Part) if has_ended => {
                        self.decoder.pass_end();
                        continue;
                    }
                    Ok(Begun::Part) => return None,
                    Err(error) => self.lost = Some(error),
                }
            }
            self.decoder.take(length);
            if !has_ended {
                return None;
            }
            self.decoder.pass_end();
            self.is_whole = false;
            if let Some(error) = self.lost.take() {
                return Some(Err(error));
            }
        }
    }

    /// Whether nothing has come behind the request that was given last, as far as that counts: on a serial line.
    #[inline]
    pub(super) fn was_last(&self) -> bool {
        !self.is_serial || self.decoder.held() == (&[], true)
    }

    /// A line has had no silence for so long that the buffer is full: takes what is past, until there is room; gives the place of what
    /// was a request for this server.
    pub(super) fn next_followed(&mut self) -> Option<Range<usize>> {
        while self.decoder.pending() > KEPT {
            let (held, _) = self.decoder.held();
            match begun(held, self.own, false, false) {
                _ if self.lost.is_some() => drop(self.decoder.take(held.len())),
                Ok(Begun::Frame(length, side)) => {
                    let range = self.decoder.take(length);
                    let is_own = self.frame(range.clone()).is_some_and(|frame| is_for(frame.unit, self.own));
                    if is_own && side == Side::Client {
                        return Some(range);
                    }
                }
                Ok(Begun::Part) => break,
                Err(error) => self.lose(error),
            }
        }
        None
    }

    /// What is held, and off TCP what comes until the end, is no frame.
    pub(super) fn lose(&mut self, error: DecodeError) {
        self.clear();
        self.lost = Some(error);
    }

    /// [`Decoder::frame`].
    #[inline(always)]
    pub(super) fn frame(&self, range: Range<usize>) -> Option<Frame<&[u8]>> {
        self.decoder.frame(range)
    }

    /// [`Decoder::corruption`], which TCP has.
    #[inline]
    pub(super) fn corruption(&self) -> Option<DecodeError> {
        self.decoder.corruption()
    }

    #[inline(always)]
    pub(super) fn has_transactions(&self) -> bool {
        self.decoder.has_transactions()
    }

    pub(super) const fn pending(&self) -> usize {
        self.decoder.pending()
    }
}

impl<F: Framings> robot_session::Decoder for Receiver<F> {
    type Frame<'a> = Frame<&'a [u8]>;
    type Error = DecodeError;

    #[inline(always)]
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.decoder.push(bytes)
    }

    fn next_frame(&mut self) -> Option<Result<Frame<&[u8]>, DecodeError>> {
        match self.advance()? {
            Ok(range) => self.frame(range).map(Ok),
            Err(error) => Some(Err(error)),
        }
    }

    fn finish(&mut self) {
        self.decoder.finish();
    }

    fn position(&self) -> u64 {
        self.decoder.position()
    }

    fn clear(&mut self) {
        (self.is_whole, self.lost) = (false, None);
        self.decoder.clear();
    }
}

/// Why a message that has ended is not whole frames.
fn no_frames(mut message: &[u8], own: Option<u8>) -> Option<DecodeError> {
    while !message.is_empty() {
        match begun(message, own, true, false) {
            Ok(Begun::Frame(length, _)) => message = message.get(length..).unwrap_or_default(),
            Ok(Begun::Part) => return None,
            Err(error) => return Some(error),
        }
    }
    None
}

/// What begins with these bytes, which may have ended, or goes on after that: the longest frame that it can be, so that no data of it is
/// read as a frame.
fn begun(data: &[u8], own: Option<u8>, has_ended: bool, goes_on: bool) -> Result<Begun, DecodeError> {
    // What a silence ends is a frame by its CRC alone, whatever its byte count says. Whether it is a reply shows nothing but its unit.
    let is_whole = has_ended && Frame::decode_rtu_whole(data).is_ok();
    if is_whole && !goes_on {
        return Ok(Begun::Frame(data.len(), Side::Client));
    }
    let is_request = data.first().is_some_and(|unit| is_for(*unit, own));
    let sides: &[Side] = if is_request { &[Side::Client] } else { &[Side::Client, Side::Server] };
    let (mut found, mut waits) = (None, false);
    for side in sides {
        match RtuLen::of(data, *side) {
            RtuLen::Known(len) if len > Frame::MAX_RTU_LEN => {}
            RtuLen::Known(len) => match data.get(..len) {
                Some(frame) if Frame::decode_rtu_whole(frame).is_ok() => {
                    found = found.max(Some((len, *side == Side::Client)));
                }
                Some(_) => {}
                None => waits = true,
            },
            RtuLen::AtLeast(_) => waits = true,
            RtuLen::Silence => {}
        }
    }
    match found {
        Some((length, is_request)) if has_ended || !waits => {
            Ok(Begun::Frame(length, if is_request { Side::Client } else { Side::Server }))
        }
        _ if waits && (!has_ended || goes_on) => Ok(Begun::Part),
        None if is_whole => Ok(Begun::Frame(data.len(), Side::Client)),
        // Without a known length, or with a wrong CRC, it may still be a frame by its end.
        None if !has_ended && data.len() <= Frame::MAX_RTU_LEN => Ok(Begun::Part),
        _ => Err(no_frame(data)),
    }
}

/// Whether a frame with this unit is for the server: nobody else replies with it, and nobody to a broadcast.
fn is_for(unit: u8, own: Option<u8>) -> bool {
    unit == 0 || own.is_none_or(|own| own == unit)
}

/// Why these bytes are no frame, seen as a request.
#[cold]
fn no_frame(data: &[u8]) -> DecodeError {
    match decoder::rtu(data, Side::Client, true) {
        Ok(expected) => DecodeError::Cut { expected, found: data.len() },
        Err(error) => error,
    }
}
