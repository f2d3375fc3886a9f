//! Bytes of a stream in, frames out.

use core::ops::Range;

use crate::error::DecodeError;
use crate::frame::{Frame, RtuLen, Side};
use crate::framing::Framing;

/// Finds the frames in a stream, whatever the pieces that it arrives in, and the next frame after corruption.
///
/// 1. [`push`](robot_session::Decoder::push) what arrived, 2. call [`next_frame`](robot_session::Decoder::next_frame) until it gives `None`. On a serial line, when
///    nothing has arrived for 3.5 characters, call [`finish`](robot_session::Decoder::finish) and drain the frames before you push on; at the end
///    of any stream, the same.
///
/// Frames and errors tile the stream: an error covers everything up to the next frame, and is given when that is found, or
/// [`finish`](robot_session::Decoder::finish) shows that there is none; [`corruption`](Self::corruption) shows it at once. How the stream was
/// cut into reads changes neither frames nor errors.
///
/// - TCP loses no bytes, so a bad header means that the peer is out of step: best close the connection and [`clear`](robot_session::Decoder::clear).
///   A caller who goes on loses no other frame: a frame of another protocol is skipped as a whole, and after any other bad header
///   the next frame is the first one whose header has the length of the request or reply after it. There is one exception, which
///   MBAP leaves open: a wrong length that a frame can have, 2 to 254. It takes what follows for its own, up to 260 bytes, and
///   the decoder is in step again at the first frame that begins where it reads the next header.
/// - On RTU, after a bad CRC the next frame is the first one to end whose CRC is right, wherever it begins; of two that end
///   together it is the longer. Noise that looks like the beginning of a long frame is discarded at the latest when the line is
///   silent. Within corruption one run of bytes in 65536 passes for a frame by chance.
/// - A function without a type of its own has no length in RTU: its frame ends with the silence alone. On no transport is it
///   looked for within corruption.
///
/// When the buffer is full, `push` takes nothing: `next_frame` makes room in it.
#[derive(Debug, Clone)]
pub struct Decoder {
    framing: Framing,
    side: Side,
    buffer: [u8; Self::CAPACITY],
    start: usize,
    end: usize,
    /// Bytes of the stream before the buffer.
    passed: u64,
    /// What is before here will not go on.
    finished_at: Option<usize>,
    /// The same of a later end, given before the first was drained.
    finished_later: Option<usize>,
    corruption: Option<Corruption>,
}

/// The bytes that a header and the length of the message after it take, but one.
const HEADER: usize = 6 + 10;

/// What is known of the corruption at the start of the buffer.
#[derive(Debug, Clone, Copy)]
struct Corruption {
    error: DecodeError,
    /// The error was given for the bytes before these: it is noise.
    is_more: bool,
    /// Where the next frame may begin.
    from: usize,
    /// Every frame that ends up to here was tried.
    tried: usize,
}

impl Decoder {
    /// The bytes that wait to be decoded, at most.
    pub const CAPACITY: usize = 1024;
    /// The longest corruption that is searched as a whole. Of more, one error covers what no frame can begin in any more.
    const WINDOW: usize = 2 * Frame::MAX_LEN;

    /// A decoder of what `side` sends.
    pub const fn new(framing: Framing, side: Side) -> Self {
        Self {
            framing,
            side,
            buffer: [0; Self::CAPACITY],
            start: 0,
            end: 0,
            passed: 0,
            finished_at: None,
            finished_later: None,
            corruption: None,
        }
    }

    /// The corruption that the stream is in, whose error waits until the next frame is found.
    pub fn corruption(&self) -> Option<DecodeError> {
        self.corruption.map(|corruption| corruption.error)
    }

    /// The bytes that wait for the rest of their frame.
    pub const fn pending(&self) -> usize {
        self.end - self.start
    }

    /// The place of the next frame in the buffer, for [`frame`](Self::frame): a borrow would not outlive a loop.
    #[inline]
    pub(crate) fn advance(&mut self) -> Option<Result<Range<usize>, DecodeError>> {
        loop {
            let limit = self.finished_at.unwrap_or(self.end);
            if let Some(corruption) = self.corruption {
                let length = self.corrupt_len(corruption, limit)?;
                if length > 0 {
                    let noise = DecodeError::Noise { length };
                    return Some(Err(if corruption.is_more { noise } else { corruption.error }));
                }
                continue; // the corruption ended where an error before it did
            }
            let data = self.buffer.get(self.start..limit)?;
            if data.is_empty() {
                self.finished_at.take()?;
                self.finished_at = self.finished_later.take();
                continue;
            }
            let begun = if self.framing.has_transactions() {
                tcp(data, self.finished_at.is_some())
            } else {
                rtu(data, self.side, self.finished_at.is_some())
            };
            match begun {
                Ok(None) => return None,
                Ok(Some(len)) => {
                    let start = self.start;
                    self.start += len;
                    return Some(Ok(start..self.start));
                }
                Err(error) => self.corruption = Some(self.corrupt(error, data)),
            }
        }
    }

    /// A frame that [`advance`](Self::advance) found.
    #[inline]
    pub(crate) fn frame(&self, range: Range<usize>) -> Option<Frame<&[u8]>> {
        let bytes = self.buffer.get(range)?;
        if self.framing.has_transactions() {
            Frame::decode_tcp(bytes).ok()?.map(|(frame, _)| frame)
        } else {
            Frame::from_rtu_parts(bytes)
        }
    }

    /// The corruption that `data` begins with.
    #[cold]
    fn corrupt(&self, error: DecodeError, data: &[u8]) -> Corruption {
        let skip = match error {
            // TCP loses nothing: a frame that its connection cuts holds no other.
            DecodeError::Cut { .. } if self.framing.has_transactions() => data.len(),
            DecodeError::Protocol { .. } | DecodeError::MbapLength { .. } => foreign_len(data),
            _ => 1,
        };
        Corruption { error, is_more: false, from: self.start + skip, tried: self.start }
    }

    /// How many bytes the corruption takes, when that is known; the start is then after them.
    fn corrupt_len(&mut self, corruption: Corruption, limit: usize) -> Option<usize> {
        let window = limit.min(self.start + Self::WINDOW);
        let (next, reach) = if self.framing.has_transactions() {
            (self.next_header(corruption, window), HEADER)
        } else {
            (self.next_rtu(corruption, window), Frame::MAX_RTU_LEN - 1)
        };
        let end = match next {
            Some(start) => {
                self.corruption = None;
                start
            }
            None if window - self.start == Self::WINDOW => {
                // A frame that is not whole yet begins within the last bytes.
                let from = window - reach;
                self.corruption = Some(Corruption { is_more: true, from, tried: window, ..corruption });
                from
            }
            None if self.finished_at.is_some() => {
                self.corruption = None;
                limit
            }
            None => {
                self.corruption.as_mut()?.tried = window;
                return None;
            }
        };
        let length = end - self.start;
        self.start = end;
        Some(length)
    }

    /// Where the next bytes begin that are an MBAP header, as far as can be seen.
    fn next_header(&self, corruption: Corruption, limit: usize) -> Option<usize> {
        for start in corruption.from..limit {
            let data = self.buffer.get(start..limit)?;
            let (six, rest) = data.split_first_chunk::<6>()?;
            if Frame::decode_tcp(six).is_err() {
                continue;
            }
            // After a frame of another protocol the next one begins in its place; elsewhere a header has to have the length of
            // the message after it.
            let is_placed = start == corruption.from && start > self.start + 1;
            let [.., high, low] = *six;
            let length = usize::from(u16::from_be_bytes([high, low]));
            match RtuLen::of(rest, self.side) {
                _ if is_placed => return Some(start),
                RtuLen::Known(len) if len == length + 2 => return Some(start),
                RtuLen::AtLeast(_) if self.finished_at.is_none() => return None,
                RtuLen::Known(_) | RtuLen::AtLeast(_) | RtuLen::Silence => {}
            }
        }
        None
    }

    /// Where the frame begins that ends first. Each beginning is tried once, when its end has come.
    fn next_rtu(&self, corruption: Corruption, limit: usize) -> Option<usize> {
        let mut first: Option<(usize, usize)> = None;
        // What begins earlier than this has ended before, and was tried.
        let from = corruption.from.max(corruption.tried.saturating_sub(Frame::MAX_RTU_LEN));
        for start in from..limit {
            let data = self.buffer.get(start..limit).unwrap_or_default();
            let RtuLen::Known(len) = RtuLen::of(data, self.side) else { continue };
            let end = start + len;
            let sooner = first.is_none_or(|(_, sooner)| end < sooner);
            if end > corruption.tried && sooner && matches!(Frame::decode_rtu(data, self.side), Ok(Some(_))) {
                first = Some((start, end));
            }
        }
        first.map(|(start, _)| start)
    }

    fn compact(&mut self) {
        let gone = self.start;
        self.buffer.copy_within(gone..self.end, 0);
        self.passed += gone as u64;
        self.start = 0;
        self.end -= gone;
        for at in [&mut self.finished_at, &mut self.finished_later].into_iter().flatten() {
            *at = at.saturating_sub(gone);
        }
        if let Some(corruption) = &mut self.corruption {
            corruption.from = corruption.from.saturating_sub(gone);
            corruption.tried = corruption.tried.saturating_sub(gone);
        }
    }
}

impl robot_session::Decoder for Decoder {
    type Frame<'a> = Frame<&'a [u8]>;
    type Error = DecodeError;

    fn push(&mut self, bytes: &[u8]) -> usize {
        if bytes.len() > Self::CAPACITY - self.end {
            self.compact();
        }
        let room = self.buffer.get_mut(self.end..).unwrap_or_default();
        let taken = room.len().min(bytes.len());
        if let (Some(to), Some(from)) = (room.get_mut(..taken), bytes.get(..taken)) {
            to.copy_from_slice(from);
        }
        self.end += taken;
        taken
    }

    fn next_frame(&mut self) -> Option<Result<Frame<&[u8]>, DecodeError>> {
        match self.advance()? {
            Ok(range) => self.frame(range).map(Ok),
            Err(error) => Some(Err(error)),
        }
    }

    fn finish(&mut self) {
        match self.finished_at {
            None => self.finished_at = Some(self.end),
            Some(_) => self.finished_later = Some(self.end),
        }
    }

    fn position(&self) -> u64 {
        self.passed + self.start as u64
    }

    fn clear(&mut self) {
        let passed = self.passed + self.end as u64;
        *self = Self { passed, ..Self::new(self.framing, self.side) };
    }
}

/// The length of the TCP frame that begins here.
#[inline]
fn tcp(data: &[u8], finished: bool) -> Result<Option<usize>, DecodeError> {
    match Frame::decode_tcp(data)? {
        Some((_, len)) => Ok(Some(len)),
        None if finished => {
            let length = data.get(4..6).and_then(<[u8]>::first_chunk);
            let expected = length.map_or(7, |length| 6 + usize::from(u16::from_be_bytes(*length)));
            Err(DecodeError::Cut { expected, found: data.len() })
        }
        None => Ok(None),
    }
}

/// What to skip of a frame whose header is bad: all of it, if its length can be one.
fn foreign_len(data: &[u8]) -> usize {
    let length = data.get(4..6).and_then(<[u8]>::first_chunk);
    let length = length.map_or(usize::MAX, |length| usize::from(u16::from_be_bytes(*length)));
    if length <= 254 { 6 + length } else { 1 }
}

/// The length of the RTU frame that begins here.
fn rtu(data: &[u8], side: Side, finished: bool) -> Result<Option<usize>, DecodeError> {
    match RtuLen::of(data, side) {
        RtuLen::Silence if finished && data.len() <= Frame::MAX_RTU_LEN => {
            Frame::decode_rtu_whole(data).map(|_| Some(data.len()))
        }
        RtuLen::AtLeast(expected) | RtuLen::Known(expected)
            if finished && data.len() < expected && expected <= Frame::MAX_RTU_LEN =>
        {
            Err(DecodeError::Cut { expected, found: data.len() })
        }
        _ => Ok(Frame::decode_rtu(data, side)?.map(|(_, len)| len)),
    }
}
