//! Bytes of a stream in, frames out.

use core::ops::Range;

use crate::error::DecodeError;
use crate::frame::{Frame, RtuLen, RtuShape, Side};
use crate::framing::{Framing, Framings};

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
pub struct Decoder<F = Framing> {
    framing: F,
    side: Side,
    buffer: [u8; CAPACITY],
    start: usize,
    end: usize,
    /// Where the frame at `start` ends at the earliest: before that nothing is decoded.
    wanted: usize,
    /// Bytes of the stream before the buffer.
    passed: u64,
    /// What is before here will not go on.
    finished_at: Option<usize>,
    /// The same of a later end, given before the first was drained.
    finished_later: Option<usize>,
    corruption: Option<Corruption>,
    ends: Ends,
}

const CAPACITY: usize = 1024;

/// The longest corruption that is searched as a whole. Of more, one error covers what no frame can begin in any more.
pub(crate) const WINDOW: usize = 2 * Frame::MAX_LEN;

/// The bytes that a header and the length of the message after it take, but one.
const HEADER: usize = 6 + 10;

/// The bytes of the shortest TCP frame.
const SHORTEST: usize = 6 + 2;

/// What is known of the corruption at the start of the buffer.
#[derive(Debug, Clone, Copy)]
struct Corruption {
    error: DecodeError,
    /// The error was given for the bytes before these: it is noise.
    is_more: bool,
    /// Where the next frame may begin.
    from: usize,
    /// TCP: every frame that begins before here was tried; RTU: every one that ends up to here.
    tried: usize,
}

/// Where the RTU frames end that may have begun within corruption: of a frame that ends at some place (modulo 256) the length less
/// one, and at its own beginning the same of another that ends there, or 0.
#[derive(Debug, Clone)]
struct Ends {
    last: [u8; 256],
    other: [u8; 256],
}

#[expect(clippy::indexing_slicing, reason = "a byte is below 256")]
impl Ends {
    const NONE: Self = Self { last: [0; 256], other: [0; 256] };

    /// Adds a frame of 5 to 256 bytes.
    fn add(&mut self, start: u8, len: usize) {
        if let Ok(less_one) = u8::try_from(len - 1) {
            let end = start.wrapping_add(less_one).wrapping_add(1);
            self.other[usize::from(start)] = core::mem::replace(&mut self.last[usize::from(end)], less_one);
        }
    }

    /// Removes one that ends here; gives its length.
    fn take(&mut self, end: u8) -> Option<usize> {
        let less_one = self.last[usize::from(end)];
        let start = end.wrapping_sub(less_one).wrapping_sub(1);
        (less_one > 0).then(|| {
            self.last[usize::from(end)] = self.other[usize::from(start)];
            usize::from(less_one) + 1
        })
    }
}

impl Decoder {
    /// The bytes that wait to be decoded, at most.
    pub const CAPACITY: usize = CAPACITY;
}

impl<F: Framings> Decoder<F> {
    /// A decoder of what `side` sends.
    pub const fn new(framing: F, side: Side) -> Self {
        Self {
            framing,
            side,
            buffer: [0; CAPACITY],
            start: 0,
            end: 0,
            wanted: 0,
            passed: 0,
            finished_at: None,
            finished_later: None,
            corruption: None,
            ends: Ends::NONE,
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

    /// Whether frames carry a transaction.
    #[inline(always)]
    pub(crate) fn has_transactions(&self) -> bool {
        self.framing.has_transactions()
    }

    /// The place of the next frame in the buffer, for [`frame`](Self::frame): a borrow would not outlive a loop.
    #[inline]
    pub(crate) fn advance(&mut self) -> Option<Result<Range<usize>, DecodeError>> {
        if self.end < self.wanted { None } else { self.judge() }
    }

    #[inline(never)]
    fn judge(&mut self) -> Option<Result<Range<usize>, DecodeError>> {
        loop {
            let limit = self.finished_at.unwrap_or(self.end);
            if self.corruption.is_some() {
                match self.end_corruption(limit)? {
                    (_, 0) => continue, // the corruption ended where an error before it did
                    (error, _) => return Some(Err(error)),
                }
            }
            let data = self.buffer.get(self.start..limit)?;
            if data.is_empty() {
                self.finished_at?;
                self.pass_end();
                continue;
            }
            let begun = if self.framing.has_transactions() {
                tcp(data)
            } else {
                rtu(data, self.side, self.finished_at.is_some())
            };
            let error = match begun {
                Ok(len) if len <= data.len() => {
                    let start = self.start;
                    self.start += len;
                    if self.finished_at.is_none() {
                        self.wanted = self.start + 1;
                    }
                    return Some(Ok(start..self.start));
                }
                Ok(expected) if self.finished_at.is_some() => {
                    // Of the seven bytes of a TCP header, six are judged.
                    let expected = if self.framing.has_transactions() { expected.max(7) } else { expected };
                    DecodeError::Cut { expected, found: data.len() }
                }
                Ok(len) => {
                    self.wanted = self.start + len;
                    return None;
                }
                Err(error) => error,
            };
            self.corrupt(error);
        }
    }

    /// A frame that [`advance`](Self::advance) found.
    #[inline(always)] // whether it has a transaction is known where the framing is
    pub(crate) fn frame(&self, range: Range<usize>) -> Option<Frame<&[u8]>> {
        let bytes = self.buffer.get(range)?;
        if self.framing.has_transactions() {
            Frame::from_tcp_parts(bytes)
        } else {
            Frame::from_rtu_parts(bytes)
        }
    }

    /// What waits, up to the end of the input where that has ended, and whether it has: for who reads without [`advance`](Self::advance).
    pub(crate) fn held(&self) -> (&[u8], bool) {
        let held = self.buffer.get(self.start..self.finished_at.unwrap_or(self.end));
        (held.unwrap_or_default(), self.finished_at.is_some())
    }

    /// Takes so many bytes of what waits; gives their place.
    pub(crate) fn take(&mut self, length: usize) -> Range<usize> {
        let start = self.start;
        self.start += length;
        start..self.start
    }

    /// What waited up to the end of the input was taken.
    pub(crate) fn pass_end(&mut self) {
        self.finished_at = self.finished_later.take();
    }

    /// Corruption begins at the start.
    #[cold]
    fn corrupt(&mut self, error: DecodeError) {
        let data = self.buffer.get(self.start..self.finished_at.unwrap_or(self.end)).unwrap_or_default();
        let skip = match error {
            // TCP loses nothing: a frame that its connection cuts holds no other.
            DecodeError::Cut { .. } if self.framing.has_transactions() => data.len(),
            DecodeError::Protocol { .. } | DecodeError::MbapLength { .. } => foreign_len(data),
            _ => 1,
        };
        self.corruption =
            Some(Corruption { error, is_more: false, from: self.start + skip, tried: self.start });
        self.ends = Ends::NONE;
    }

    /// What the corruption was and how many bytes it takes, when that is known; the start is then after them.
    fn end_corruption(&mut self, limit: usize) -> Option<(DecodeError, usize)> {
        let corruption = self.corruption.as_mut()?;
        let (from, tried) = (corruption.from, corruption.tried);
        let window = limit.min(self.start + WINDOW);
        let (next, reach) = if self.framing.has_transactions() {
            (self.next_header(from, tried, window), HEADER)
        } else {
            (self.next_rtu(from, tried, window), Frame::MAX_RTU_LEN - 1)
        };
        let is_full = window - self.start == WINDOW;
        let corruption = self.corruption.as_mut()?;
        if let (Err(tried), false, None) = (next, is_full, self.finished_at) {
            corruption.tried = tried;
            if self.framing.has_transactions() {
                self.wanted = tried + SHORTEST;
            }
            return None;
        }
        let (error, is_more) = (corruption.error, corruption.is_more);
        let end = match next {
            Ok(start) => {
                self.corruption = None;
                start
            }
            Err(tried) if is_full => {
                // A frame that is not whole yet begins within the last bytes.
                let from = window - reach;
                *corruption = Corruption { is_more: true, from, tried, ..*corruption };
                from
            }
            Err(_) => {
                self.corruption = None;
                limit
            }
        };
        let length = end - self.start;
        self.start = end;
        Some((if is_more { DecodeError::Noise { length } } else { error }, length))
    }

    /// Where the next bytes begin that are an MBAP header, as far as can be seen; else what was tried.
    #[inline(never)]
    fn next_header(&self, from: usize, tried: usize, limit: usize) -> Result<usize, usize> {
        let mut rest = self.buffer.get(from.max(tried)..limit).unwrap_or_default();
        while let [_, after @ ..] = rest {
            let (data, start) = (rest, limit - rest.len());
            rest = after;
            // Protocol 0, a length below 256: judged as soon as it is there.
            if let [_, _, p0, ..] = *data
                && (p0 != 0
                    || data.get(3).is_some_and(|p1| *p1 != 0)
                    || data.get(4).is_some_and(|l0| *l0 != 0))
            {
                continue;
            }
            let Some((six, message)) = data.split_first_chunk() else { return Err(start) };
            let Ok(len) = Frame::tcp_len(six) else { continue };
            // After a frame of another protocol the next one begins in its place; elsewhere a header has to have the length of
            // the message after it.
            let is_placed = start == from && start > self.start + 1;
            match RtuLen::of(message, self.side) {
                _ if is_placed => return Ok(start),
                RtuLen::Known(rtu) if 6 + rtu == len + 2 => return Ok(start),
                RtuLen::AtLeast(_) if self.finished_at.is_none() => return Err(start),
                RtuLen::Known(_) | RtuLen::AtLeast(_) | RtuLen::Silence => {}
            }
        }
        Err(limit)
    }

    /// Where the frame begins that ends first, and of those the longest; else what was tried. A beginning is noted with the byte
    /// that shows its length, and tried when its end has come.
    #[inline(never)]
    fn next_rtu(&mut self, from: usize, tried: usize, limit: usize) -> Result<usize, usize> {
        let shown_by: &[usize] = match self.side {
            Side::Client => &[1, 6, 10],
            Side::Server => &[1, 2],
        };
        for end in tried + 1..=limit {
            for at in shown_by {
                let Some(start) = end.checked_sub(at + 1).filter(|start| *start >= from) else {
                    break;
                };
                let data = self.buffer.get(start..end).unwrap_or_default();
                let (Some(code), Some(shows)) = (data.get(1), data.last()) else { break };
                let len = match RtuShape::of(*code, self.side) {
                    RtuShape::Fixed(len) if *at == 1 => len,
                    RtuShape::Counted { at: count_at } if count_at == *at => at + 3 + usize::from(*shows),
                    _ => continue,
                };
                self.ends.add(self.place(start), len);
            }
            let mut longest = None;
            while let Some(len) = self.ends.take(self.place(end)) {
                let frame = self.buffer.get(end.saturating_sub(len)..end).unwrap_or_default();
                if Frame::decode_rtu_whole(frame).is_ok() {
                    longest = longest.max(Some(len));
                }
            }
            if let Some(len) = longest {
                return Ok(end.saturating_sub(len));
            }
        }
        Err(limit)
    }

    /// A place in the stream, modulo 256.
    fn place(&self, index: usize) -> u8 {
        let [low, ..] = (self.passed + index as u64).to_le_bytes();
        low
    }

    fn compact(&mut self) {
        let gone = self.start;
        self.buffer.copy_within(gone..self.end, 0);
        self.passed += gone as u64;
        self.start = 0;
        self.end -= gone;
        self.wanted = self.wanted.saturating_sub(gone);
        for at in [&mut self.finished_at, &mut self.finished_later].into_iter().flatten() {
            *at = at.saturating_sub(gone);
        }
        if let Some(corruption) = &mut self.corruption {
            corruption.from = corruption.from.saturating_sub(gone);
            corruption.tried = corruption.tried.saturating_sub(gone);
        }
    }
}

impl<F: Framings> robot_session::Decoder for Decoder<F> {
    type Frame<'a> = Frame<&'a [u8]>;
    type Error = DecodeError;

    #[inline]
    fn push(&mut self, bytes: &[u8]) -> usize {
        if bytes.len() > CAPACITY - self.end {
            self.compact();
        }
        // A port that gives single bytes: no call to copy one.
        if let ([byte], Some(room)) = (bytes, self.buffer.get_mut(self.end)) {
            *room = *byte;
            self.end += 1;
            return 1;
        }
        let room = self.buffer.get_mut(self.end..).unwrap_or_default();
        let taken = room.len().min(bytes.len());
        if let (Some(to), Some(from)) = (room.get_mut(..taken), bytes.get(..taken)) {
            to.copy_from_slice(from);
        }
        self.end += taken;
        taken
    }

    #[inline]
    fn next_frame(&mut self) -> Option<Result<Frame<&[u8]>, DecodeError>> {
        match self.advance()? {
            Ok(range) => self.frame(range).map(Ok),
            Err(error) => Some(Err(error)),
        }
    }

    fn finish(&mut self) {
        match self.finished_at {
            None => (self.finished_at, self.wanted) = (Some(self.end), 0),
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

/// The length of the TCP frame that begins here, or how many bytes show it.
#[inline]
fn tcp(data: &[u8]) -> Result<usize, DecodeError> {
    data.first_chunk().map_or(Ok(6), Frame::tcp_len)
}

/// What to skip of a frame whose header is bad: all of it, if its length can be one.
fn foreign_len(data: &[u8]) -> usize {
    let length = data.get(4..6).and_then(<[u8]>::first_chunk);
    let length = length.map_or(usize::MAX, |length| usize::from(u16::from_be_bytes(*length)));
    if length <= 254 { 6 + length } else { 1 }
}

/// The length of the RTU frame that begins here, or how many bytes show it.
pub(crate) fn rtu(data: &[u8], side: Side, finished: bool) -> Result<usize, DecodeError> {
    let (RtuLen::Known(len) | RtuLen::AtLeast(len)) = RtuLen::of(data, side) else {
        // However many bytes there are: how the stream was cut must not show.
        let too_long = Frame::MAX_RTU_LEN + 1;
        return match data.len() {
            len if len >= too_long => Err(DecodeError::TooLong { found: too_long }),
            len if finished => Frame::decode_rtu_whole(data).map(|_| len),
            _ => Ok(too_long),
        };
    };
    match data.get(..len) {
        _ if len > Frame::MAX_RTU_LEN => Err(DecodeError::TooLong { found: len }),
        Some(frame) => Frame::decode_rtu_whole(frame).map(|_| len),
        None => Ok(len),
    }
}
