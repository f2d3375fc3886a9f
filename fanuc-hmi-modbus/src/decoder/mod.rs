//! Bytes of a stream in, frames out.

pub(crate) mod rtu;
mod tcp;

use core::ops::Range;

use crate::error::DecodeError;
use crate::frame::{Frame, Side};
use crate::framing::Framing;
use crate::message::function;
use crate::stream::{CAPACITY, Stream};
use rtu::Ends;
use tcp::{EXCEPTION, HEADER, MBAP, MIN_LEN};

/// Finds the frames in a stream, wherever reads split it, and the next frame after corruption.
///
/// 1. [`push`](robot_session::Decoder::push) the bytes that have arrived, 2. call
///    [`next_frame`](robot_session::Decoder::next_frame) until it returns `None`. On a serial line, when nothing has arrived for
///    3.5 characters, call [`finish`](robot_session::Decoder::finish) and drain the frames before you push on; at the end of any
///    stream, the same.
///
/// Frames and errors cover the stream without gaps: an error covers everything up to the next frame, and is returned when
/// that is found, or [`finish`](robot_session::Decoder::finish) shows that no frame follows; [`corruption`](Self::corruption)
/// shows it at once. The division of the stream into reads has no effect on frames and errors.
///
/// - TCP loses no bytes, so a bad header means that the peer is out of step: best close the connection and
///   [`clear`](robot_session::Decoder::clear). A caller that continues loses no other frame: a frame of another protocol is
///   skipped as a whole, and after any other bad header the next frame is the first one whose header has the length of the
///   request or reply after it. There is one exception, which MBAP leaves open: a wrong length that a frame can have, 2 to
///   254. Such a header takes the next bytes for its own, up to 260, and the decoder is in step again at the first frame that
///   begins where it reads the next header.
/// - Some servers send an exception over TCP with a wrong length, often 4. It still has two bytes of PDU: it is
///   [`DecodeError::ExceptionLength`] as soon as these have arrived, and costs no other frame, whether the server sends as
///   many bytes as the header states or not.
/// - On RTU, after a bad CRC the next frame is the first one to end whose CRC is right, wherever it begins; of two that end
///   together it is the longer. Noise that looks like the beginning of a long frame is discarded at the latest when the line is
///   silent. Within corruption one run of bytes in 65536 passes for a frame by chance.
/// - A function without a type of its own has no length in RTU: its frame ends with the silence alone. On no transport is it
///   searched for within corruption.
///
/// When the buffer is full, `push` takes nothing: `next_frame` frees space in it.
#[derive(Debug, Clone)]
pub struct Decoder {
    framing: Framing,
    side: Side,
    stream: Stream,
    /// The earliest end of the frame at `start`: before that nothing is decoded.
    wanted: usize,
    corruption: Option<Corruption>,
    ends: Ends,
    /// The bytes that may follow the last frame, an exception with a wrong length, before the next one begins.
    excess: usize,
}

/// The longest corruption that is searched as a whole. Of a longer one, an error covers the bytes in which no frame can begin
/// any more.
pub(crate) const WINDOW: usize = 2 * Frame::MAX_LEN;

/// The state of the corruption at the start of the buffer.
#[derive(Debug, Clone, Copy)]
struct Corruption {
    error: DecodeError,
    /// Whether the error was returned for the bytes before these: then they are noise.
    is_more: bool,
    /// The index at which the next frame may begin.
    from: usize,
    /// TCP: every frame that begins before this index was tried; RTU: every frame that ends up to it.
    tried: usize,
}

impl Decoder {
    /// The maximum number of bytes that wait to be decoded.
    pub const CAPACITY: usize = CAPACITY;
}

impl Decoder {
    /// Creates a decoder of the frames that `side` sends.
    pub const fn new(framing: Framing, side: Side) -> Self {
        Self {
            framing,
            side,
            stream: Stream::new(),
            wanted: 0,
            corruption: None,
            ends: Ends::NONE,
            excess: 0,
        }
    }

    /// Returns the corruption that the stream is in, whose error waits until the next frame is found.
    pub fn corruption(&self) -> Option<DecodeError> {
        self.corruption.map(|corruption| corruption.error)
    }

    /// Returns the number of bytes that wait for the rest of their frame.
    pub const fn pending(&self) -> usize {
        self.stream.pending()
    }

    /// Returns [`pending`](Self::pending) without the bytes that an exception with a wrong length may have in addition.
    pub(crate) const fn pending_reply(&self) -> usize {
        self.stream.pending().saturating_sub(self.excess)
    }

    /// Returns the waiting bytes.
    pub(crate) fn held(&self) -> &[u8] {
        self.stream.held()
    }

    /// Returns whether the input has ended after a frame that [`advance`](Self::advance) found.
    pub(crate) fn is_last(&self, frame: &Range<usize>) -> bool {
        self.stream.has_ended() && frame.end == self.stream.limit()
    }

    /// Returns whether nothing has come yet after a frame that [`advance`](Self::advance) found, and the input may continue.
    pub(crate) const fn is_open(&self, frame: &Range<usize>) -> bool {
        !self.stream.has_ended() && frame.end == self.stream.end()
    }

    /// Returns such a frame to the waiting bytes, until more come or the input ends.
    #[cold]
    pub(crate) fn put_back(&mut self, frame: &Range<usize>) {
        self.stream.put_back(frame);
        self.want(1, frame.end);
    }

    /// Returns whether frames have a transaction.
    #[inline(always)]
    pub(crate) fn has_transactions(&self) -> bool {
        self.framing.has_transactions()
    }

    /// Returns the range of the next frame in the buffer, for [`frame`](Self::frame): a borrow would not outlive a loop.
    #[inline]
    pub(crate) fn advance(&mut self) -> Option<Result<Range<usize>, DecodeError>> {
        if self.stream.end() < self.wanted { None } else { self.judge() }
    }

    #[inline(never)]
    fn judge(&mut self) -> Option<Result<Range<usize>, DecodeError>> {
        loop {
            let limit = self.stream.limit();
            if self.corruption.is_some() {
                match self.end_corruption(limit)? {
                    (_, 0) => continue, // the corruption ended where an error before it did
                    (error, _) => return Some(Err(error)),
                }
            }
            if self.excess > 0 {
                match self.end_exception(limit)? {
                    0 => {}
                    length => return Some(Err(DecodeError::Noise { length })),
                }
            }
            let has_ended = self.stream.has_ended();
            let data = self.stream.get(self.stream.start()..limit)?;
            if data.is_empty() {
                if !has_ended {
                    return None;
                }
                self.stream.pass_end();
                continue;
            }
            let begun = if self.framing.has_transactions() {
                tcp::len(data, self.side)
            } else {
                rtu::len(data, self.side, has_ended)
            };
            let error = match begun {
                Ok(len) if len <= data.len() => {
                    if len <= EXCEPTION && self.framing.has_transactions() {
                        self.excess = tcp::excess(data, self.side);
                    }
                    let frame = self.stream.take(len);
                    if !has_ended {
                        self.want(1, frame.end);
                    }
                    return Some(Ok(frame));
                }
                Ok(expected) if has_ended => {
                    // Six of the seven bytes of a TCP header are checked.
                    let expected = if self.framing.has_transactions() { expected.max(7) } else { expected };
                    DecodeError::Cut { expected, found: data.len() }
                }
                Ok(len) => {
                    // The function shows whether the header is right.
                    let is_short = data.len() < MIN_LEN && self.framing.has_transactions();
                    self.want(if is_short { len.min(MIN_LEN) } else { len }, self.stream.start());
                    return None;
                }
                Err(error) => error,
            };
            let from = self.corrupt(error);
            if from > limit && !has_ended {
                self.want(MBAP, from);
                return None; // the frame that is passed over has not come whole
            }
        }
    }

    /// Delays decoding until `count` bytes from `from` on have come.
    #[inline]
    fn want(&mut self, count: usize, from: usize) {
        self.wanted = from + count;
    }

    /// Returns a frame that [`advance`](Self::advance) found.
    #[inline(always)] // whether it has a transaction is known where the framing is
    pub(crate) fn frame(&self, range: Range<usize>) -> Option<Frame<&[u8]>> {
        let bytes = self.stream.get(range)?;
        if self.framing.has_transactions() {
            Frame::from_tcp_parts(bytes)
        } else {
            Frame::from_rtu_parts(bytes)
        }
    }

    /// Returns the error of such a frame, if it is an exception whose header has another length.
    #[inline]
    pub(crate) fn exception_error(&self, frame: &Range<usize>) -> Option<DecodeError> {
        if frame.len() != EXCEPTION || !self.framing.has_transactions() {
            return None;
        }
        tcp::exception_error(self.stream.get(frame.clone())?, self.side)
    }

    /// Looks for the next frame after an exception with a wrong length. Returns the bytes before it.
    #[cold]
    fn end_exception(&mut self, limit: usize) -> Option<usize> {
        let start = self.stream.start();
        let mut length = self.excess;
        for at in 0..self.excess {
            let rest = self.stream.get(start + at..limit).unwrap_or_default();
            let Some(shortest) = rest.first_chunk::<MIN_LEN>() else {
                if self.stream.has_ended() {
                    length = at;
                    break;
                }
                self.want(MIN_LEN, start + at);
                return None;
            };
            let [t0, t1, p0, p1, l0, l1, _, code] = *shortest;
            let is_header = Frame::tcp_len(&[t0, t1, p0, p1, l0, l1]).is_ok();
            if is_header && code & !function::EXCEPTION != 0 {
                length = at;
                break;
            }
        }
        self.excess = 0;
        self.stream.take(length);
        Some(length)
    }

    /// Begins a corruption at the start. Returns the index at which the search for the next frame begins.
    #[cold]
    fn corrupt(&mut self, error: DecodeError) -> usize {
        let (data, start) = (self.stream.held(), self.stream.start());
        let skip = match error {
            // TCP loses nothing: a frame that its connection truncates contains no other.
            DecodeError::Cut { .. } if self.framing.has_transactions() => data.len(),
            DecodeError::Protocol { .. } | DecodeError::MbapLength { .. } => tcp::foreign_len(data),
            _ => 1,
        };
        let from = start + skip;
        self.corruption = Some(Corruption { error, is_more: false, from, tried: start });
        self.ends = Ends::NONE;
        from
    }

    /// Returns the error of the corruption and the number of its bytes, when that is known; the start is then after them.
    fn end_corruption(&mut self, limit: usize) -> Option<(DecodeError, usize)> {
        let corruption = self.corruption.as_mut()?;
        let (from, tried) = (corruption.from, corruption.tried);
        let start = self.stream.start();
        let window = limit.min(start + WINDOW);
        let (next, reach) = if self.framing.has_transactions() {
            (tcp::next(&self.stream, self.side, from, tried, window), HEADER)
        } else {
            (self.ends.next(&self.stream, self.side, from, tried, window), Frame::MAX_RTU_LEN - 1)
        };
        let is_full = window - start == WINDOW;
        let corruption = self.corruption.as_mut()?;
        if let (Err(tried), false, false) = (next, is_full, self.stream.has_ended()) {
            corruption.tried = tried;
            if self.framing.has_transactions() {
                let shows = if tcp::is_placed(tried, from, start) { MBAP } else { MIN_LEN };
                // A full window is decided without them.
                self.wanted = (tried + shows).min(start + WINDOW);
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
                (corruption.is_more, corruption.from, corruption.tried) = (true, from, tried);
                from
            }
            Err(_) => {
                self.corruption = None;
                limit
            }
        };
        let length = end - start;
        self.stream.take(length);
        Some((if is_more { DecodeError::Noise { length } } else { error }, length))
    }

    #[inline(never)] // rare, and `push` is built in
    fn compact(&mut self) {
        let gone = self.stream.compact();
        self.wanted = self.wanted.saturating_sub(gone);
        if let Some(corruption) = &mut self.corruption {
            corruption.from = corruption.from.saturating_sub(gone);
            corruption.tried = corruption.tried.saturating_sub(gone);
        }
    }
}

impl robot_session::Decoder for Decoder {
    type Frame<'a> = Frame<&'a [u8]>;
    type Error = DecodeError;

    #[inline]
    fn push(&mut self, bytes: &[u8]) -> usize {
        if self.stream.is_tight(bytes.len()) {
            self.compact();
        }
        self.stream.push(bytes)
    }

    #[inline]
    fn next_frame(&mut self) -> Option<Result<Frame<&[u8]>, DecodeError>> {
        match self.advance()? {
            Ok(range) => match self.exception_error(&range) {
                Some(error) => Some(Err(error)),
                None => self.frame(range).map(Ok),
            },
            Err(error) => Some(Err(error)),
        }
    }

    fn finish(&mut self) {
        if !self.stream.has_ended() {
            self.wanted = 0;
        }
        self.stream.finish();
    }

    fn position(&self) -> u64 {
        self.stream.position()
    }

    fn clear(&mut self) {
        self.stream.clear();
        (self.wanted, self.corruption, self.ends, self.excess) = (0, None, Ends::NONE, 0);
    }
}
