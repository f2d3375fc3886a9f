//! The requests among RTU frames.

use core::ops::Range;

use robot_session::Decoder as _;

use crate::decoder::rtu;
use crate::error::DecodeError;
use crate::frame::{Frame, RtuLen, Side};
use crate::framing::Framing;
use crate::stream::Stream;

/// The receiver of RTU frames. They may come from other units as well, on a line that damages them, and any data may look
/// like a request. So a frame begins at the beginning of the input, or after a whole frame of either direction, and only
/// there; after bytes that are not a frame, nothing is read until the input ends. Through TCP, which loses no bytes, the
/// rest of a frame may come after any stall. On a serial line, on which the silence ends a message, the message is read when
/// it has ended, and consists of whole frames or is not read. A frame whose length is known and not reached may continue
/// after the silence. If it then turns out not to be a frame, the bytes after the silence are read separately.
#[derive(Debug, Clone)]
pub struct RtuReceiver {
    stream: Stream,
    /// The unit whose requests are read; all other frames on the line may also be replies.
    own: Option<u8>,
    is_serial: bool,
    /// Whether the held bytes up to their end are whole frames.
    is_whole: bool,
    /// Whether the end is a silence, after which an incomplete frame may continue.
    is_pause: bool,
    /// The silences within the held bytes.
    silences: Silences,
    /// The error of the bytes until the end, which are not a frame.
    lost: Option<DecodeError>,
}

/// The frame, or the part of one, that some bytes begin.
enum Prefix {
    /// A frame of this many bytes.
    Frame(usize, Side),
    /// More bytes must come.
    Incomplete,
}

/// The number of bytes of a line without a silence that stay buffered: a frame may have begun in them.
const BUFFERED_LEN: usize = Frame::MAX_RTU_LEN;

impl RtuReceiver {
    #[inline(never)]
    fn judge(&mut self) -> Option<Result<Range<usize>, DecodeError>> {
        loop {
            let (held, has_ended) = (self.stream.held(), self.stream.has_ended());
            let length = held.len();
            if self.lost.is_none() && length > 0 {
                if has_ended && self.is_serial && !self.is_whole {
                    // In most cases it is one frame.
                    if Frame::decode_rtu_whole(held).is_ok() {
                        return Some(Ok(self.stream.take(length)));
                    }
                    if let Some(error) = no_frames(held, self.own) {
                        let start = self.stream.start();
                        if self.is_pause && self.may_go_on(held) {
                            self.silences.add(start + length);
                            self.stream.pass_end();
                            continue;
                        }
                        if let Some(next) = self.silences.between(start, start + length) {
                            let piece = held.get(..next - start).unwrap_or_default();
                            let error = no_frames(piece, self.own).unwrap_or(error);
                            self.stream.take(next - start);
                            return Some(Err(error));
                        }
                        self.lost = Some(error);
                    } else {
                        self.is_whole = true;
                    }
                }
                match begun(held, self.own, has_ended, !self.is_serial) {
                    _ if self.lost.is_some() => {}
                    Ok(Prefix::Frame(length, side)) => {
                        let range = self.stream.take(length);
                        match side {
                            Side::Client => return Some(Ok(range)),
                            Side::Server => continue,
                        }
                    }
                    Ok(Prefix::Incomplete) if has_ended => {
                        self.stream.pass_end();
                        continue;
                    }
                    Ok(Prefix::Incomplete) => return None,
                    Err(error) => self.lost = Some(error),
                }
            }
            self.stream.take(length);
            if !has_ended {
                return None;
            }
            self.stream.pass_end();
            (self.is_whole, self.silences) = (false, Silences::NONE);
            if let Some(error) = self.lost.take() {
                return Some(Err(error));
            }
        }
    }
}

impl RtuReceiver {
    /// Returns whether the bytes before a silence are whole frames and the beginning of another. A beginning without a known
    /// length does not count if the bytes after an earlier silence are whole frames.
    fn may_go_on(&self, held: &[u8]) -> bool {
        let start = self.stream.start();
        let mut rest = held;
        loop {
            match begun(rest, self.own, false, false) {
                Ok(Prefix::Frame(length, _)) => rest = rest.get(length..).unwrap_or_default(),
                Ok(Prefix::Incomplete) => break,
                Err(_) => return false,
            }
        }
        let lengths = || sides(rest, self.own).iter().map(|side| RtuLen::of(rest, *side));
        let is_short = |length| match length {
            RtuLen::Known(length) => rest.len() < length && length <= Frame::MAX_RTU_LEN,
            RtuLen::AtLeast(_) => true,
            RtuLen::Silence => false,
        };
        if lengths().any(is_short) {
            return true;
        }
        if !lengths().any(|length| matches!(length, RtuLen::Silence)) {
            return false;
        }
        let mut at = start;
        while let Some(next) = self.silences.between(at, start + held.len()) {
            if no_frames(held.get(next - start..).unwrap_or_default(), self.own).is_none() {
                return false;
            }
            at = next;
        }
        true
    }
}

impl RtuReceiver {
    pub(super) fn new(framing: Framing, own: Option<u8>) -> Self {
        Self {
            stream: Stream::new(),
            own,
            is_serial: framing.is_serial(),
            is_whole: false,
            is_pause: false,
            silences: Silences::NONE,
            lost: None,
        }
    }

    pub(super) fn pause(&mut self) {
        self.stream.finish();
        self.is_pause = true;
    }

    pub(super) fn is_partial(&self) -> bool {
        self.is_serial && self.lost.is_none() && self.stream.pending() > 0
    }

    #[inline(always)] // into the one place that reads
    pub(super) fn advance(&mut self) -> Option<Result<Range<usize>, DecodeError>> {
        // In most cases there is nothing.
        if self.stream.pending() == 0 && !self.stream.has_ended() { None } else { self.judge() }
    }

    #[inline(always)]
    pub(super) fn frame(&self, range: Range<usize>) -> Option<Frame<&[u8]>> {
        Frame::from_rtu_parts(self.stream.get(range)?)
    }

    #[inline]
    pub(super) fn was_last(&self) -> bool {
        !self.is_serial || self.stream.has_ended() && self.stream.held().is_empty()
    }

    pub(super) fn next_followed(&mut self) -> Option<Range<usize>> {
        while self.stream.pending() > BUFFERED_LEN {
            let held = self.stream.held();
            match begun(held, self.own, false, false) {
                _ if self.lost.is_some() => drop(self.stream.take(held.len())),
                Ok(Prefix::Frame(length, side)) => {
                    let range = self.stream.take(length);
                    let is_own = self.frame(range.clone()).is_some_and(|frame| is_for(frame.unit, self.own));
                    if is_own && side == Side::Client {
                        return Some(range);
                    }
                }
                Ok(Prefix::Incomplete) => break,
                Err(error) => self.lose(error),
            }
        }
        None
    }

    /// Records that the bytes until the end are not a frame either.
    pub(super) fn lose(&mut self, error: DecodeError) {
        self.clear();
        self.lost = Some(error);
    }

    pub(super) fn pending(&self) -> usize {
        self.stream.pending()
    }
}

impl robot_session::Decoder for RtuReceiver {
    type Frame<'a> = Frame<&'a [u8]>;
    type Error = DecodeError;

    #[inline(always)]
    fn push(&mut self, bytes: &[u8]) -> usize {
        if self.stream.is_tight(bytes.len()) {
            let gone = self.stream.compact();
            self.silences.move_back(gone);
        }
        self.stream.push(bytes)
    }

    fn next_frame(&mut self) -> Option<Result<Frame<&[u8]>, DecodeError>> {
        match self.advance()? {
            Ok(range) => self.frame(range).map(Ok),
            Err(error) => Some(Err(error)),
        }
    }

    fn finish(&mut self) {
        self.stream.finish();
        self.is_pause = false;
    }

    fn position(&self) -> u64 {
        self.stream.position()
    }

    fn clear(&mut self) {
        (self.is_whole, self.lost, self.silences) = (false, None, Silences::NONE);
        self.stream.clear();
    }
}

/// The indices of silences in a stream; the first ones of a message, if there are more than fit.
#[derive(Debug, Clone, Copy)]
struct Silences([u16; Self::MAX_SILENCES]);

impl Silences {
    /// The maximum number of silences: the pieces of a longest frame, of 8 bytes each.
    const MAX_SILENCES: usize = Frame::MAX_RTU_LEN / 8;
    const NONE: Self = Self([0; Self::MAX_SILENCES]);

    /// Adds a silence at this index, above zero.
    fn add(&mut self, at: usize) {
        if let (Some(free), Ok(at)) = (self.0.iter_mut().find(|it| **it == 0), u16::try_from(at)) {
            *free = at;
        }
    }

    /// Returns the first silence between two indices.
    fn between(&self, start: usize, end: usize) -> Option<usize> {
        self.0.iter().map(|at| usize::from(*at)).filter(|at| start < *at && *at < end).min()
    }

    /// Subtracts `gone` from the indices; the silences before it are discarded.
    fn move_back(&mut self, gone: usize) {
        for at in &mut self.0 {
            *at = usize::from(*at).checked_sub(gone).and_then(|at| u16::try_from(at).ok()).unwrap_or(0);
        }
    }
}

/// Returns the sides that may have sent a frame that begins here: a request for the server is not a reply of another one.
fn sides(data: &[u8], own: Option<u8>) -> &'static [Side] {
    let is_request = data.first().is_some_and(|unit| is_for(*unit, own));
    if is_request { &[Side::Client] } else { &[Side::Client, Side::Server] }
}

/// Returns the reason that a message that has ended is not whole frames.
fn no_frames(mut message: &[u8], own: Option<u8>) -> Option<DecodeError> {
    while !message.is_empty() {
        match begun(message, own, true, false) {
            Ok(Prefix::Frame(length, _)) => message = message.get(length..).unwrap_or_default(),
            Ok(Prefix::Incomplete) => return None,
            Err(error) => return Some(error),
        }
    }
    None
}

/// Returns the frame, or the part of one, that these bytes begin; they may have ended, or continue after that. It is the
/// longest possible frame, so that no data of it is read as a frame.
fn begun(data: &[u8], own: Option<u8>, has_ended: bool, goes_on: bool) -> Result<Prefix, DecodeError> {
    // Before a silence, bytes are a frame by their CRC alone, whatever their byte count. Only the unit shows whether it is a
    // reply.
    let is_whole = has_ended && Frame::decode_rtu_whole(data).is_ok();
    if is_whole && !goes_on {
        return Ok(Prefix::Frame(data.len(), Side::Client));
    }
    let (mut found, mut waits) = (None, false);
    for side in sides(data, own) {
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
            Ok(Prefix::Frame(length, if is_request { Side::Client } else { Side::Server }))
        }
        _ if waits && (!has_ended || goes_on) => Ok(Prefix::Incomplete),
        None if is_whole => Ok(Prefix::Frame(data.len(), Side::Client)),
        // Without a known length, or with a wrong CRC, the bytes may still be a frame by their end.
        None if !has_ended && data.len() <= Frame::MAX_RTU_LEN => Ok(Prefix::Incomplete),
        _ => Err(no_frame(data)),
    }
}

/// Returns whether a frame with this unit is for the server: no other server replies with it, and none to a broadcast.
fn is_for(unit: u8, own: Option<u8>) -> bool {
    unit == 0 || own.is_none_or(|own| own == unit)
}

/// Returns the reason that these bytes, as a request, are not a frame.
#[cold]
fn no_frame(data: &[u8]) -> DecodeError {
    match rtu::len(data, Side::Client, true) {
        Ok(expected) => DecodeError::Cut { expected, found: data.len() },
        Err(error) => error,
    }
}
