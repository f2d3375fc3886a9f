//! Bytes in, messages out; continues after corrupt bytes.

use core::marker::PhantomData;

use crate::error::DecodeError;
use crate::frame::{Frame, Reading, find_dle, plain_data, plain_len};
use crate::framing::{DLE, ETX, Framing, STX};
use crate::message::Message;

/// A message, and the offset of its frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReceivedMessage<M> {
    /// The frame's first byte, counted from the first byte that the decoder was given; wraps with `usize`.
    pub offset: usize,
    /// The frame's length on the line, in bytes.
    pub length: usize,
    /// The decoded message.
    pub message: M,
}

/// Finds the messages of one side ([`RobotMessage`](crate::RobotMessage) or [`HostMessage`](crate::HostMessage)) in a
/// stream. Its verbs are those of [`robot_session::Decoder`]; when the line is silent in the middle of a frame, or ends, call
/// `finish`.
///
/// The start mark is not unique: data `10 02` is doubled to `10 10 02`. When a frame is cut off, the next one looks like
/// its data, and both would be lost. So when a frame turns out to be corrupt, only the first byte of its start mark is
/// given up, and the rest of its *raw* bytes is searched again. A frame is consumed only once its marks, its checksum and
/// its message are right; one that was found among the bytes of a corrupt frame must also name only codes that the source
/// names ([`Message::is_plausible`]). The work is bounded: a byte is looked at once for each start mark in the
/// [`Frame::MAX_LEN`] bytes before it.
///
/// Frames and errors cover the stream without gaps: an error covers the bytes from the start mark of a corrupt frame to the
/// possible beginning of the next frame, which may be inside it. The end of the error is known when the next start mark
/// comes; that the frame is corrupt is certain earlier, and [`corruption`](Self::corruption) returns the error then.
#[derive(Debug, Clone)]
pub struct Decoder<M> {
    framing: Framing,
    /// The bytes after the first `CAPACITY` fill the words of a frame that is read there.
    buffer: [u8; CAPACITY + Frame::MAX_LEN],
    start: usize,
    end: usize,
    /// The offset after the frame or error that `next_frame` returned last.
    position: u64,
    /// Bytes from `position` on that belong to no frame and are not reported yet.
    skipped: u64,
    /// DLEs after them: part of the next frame if a start mark follows, otherwise skipped.
    spare_dles: usize,
    /// `buffer[start]` is the checksum of the previous frame: counted there, but perhaps the first DLE of the next
    /// start mark.
    lent: bool,
    /// The number of bytes from `start` on that have been read as a corrupt frame: a frame that begins there is a
    /// second reading.
    read_before: usize,
    /// The frame at `start`, as far as it was read.
    reading: Reading,
    /// The error of the skipped bytes, if a frame began there.
    error: Option<DecodeError>,
    /// The same, until `corruption` returns it.
    news: Option<DecodeError>,
    finished: bool,
    side: PhantomData<M>,
}

const CAPACITY: usize = 2 * Frame::MAX_LEN;

/// The shortest frame: one byte of data.
const MIN_LEN: usize = 6;

impl<M: Message> Decoder<M> {
    /// Creates a decoder at the beginning of a stream.
    pub fn new(framing: Framing) -> Self {
        Self {
            framing,
            buffer: [0; _],
            start: 0,
            end: 0,
            position: 0,
            skipped: 0,
            spare_dles: 0,
            lent: false,
            read_before: 0,
            reading: Reading::NEW,
            error: None,
            news: None,
            finished: false,
            side: PhantomData,
        }
    }

    /// Returns the error of a corrupt frame, once, as soon as `next_frame` has found it; `next_frame` returns it when the
    /// extent of the frame is known. For an end that must answer at once.
    pub fn corruption(&mut self) -> Option<DecodeError> {
        self.news.take()
    }

    /// Returns the number of bytes that were returned neither as a frame nor as an error.
    pub fn pending(&self) -> usize {
        whole(self.skipped).saturating_add(self.held())
    }

    fn held(&self) -> usize {
        self.spare_dles + (self.end - self.start) - usize::from(self.lent)
    }

    /// Returns the offset of a frame or an error.
    #[expect(clippy::cast_possible_truncation, reason = "the offset wraps")]
    const fn offset(&self) -> usize {
        self.position as usize
    }

    /// Reads the frame at `start`, of which `available` bytes are there. An error comes with the number of bytes that it is
    /// about.
    #[inline]
    fn read(&mut self, available: usize, finished: bool) -> Result<Option<(M, usize)>, (DecodeError, usize)> {
        let bytes = self.buffer.get(self.start..self.start + available).unwrap_or_default();
        match self.reading.read(bytes, self.framing, M::MAX_DATA) {
            Ok(Some(length)) => match M::decode(self.reading.frame.data(), self.framing) {
                Ok(message) if self.read_before > 0 && !message.is_plausible() => {
                    let found = self.reading.frame.data().len();
                    Err((DecodeError::Length { offset: 0, found }, length))
                }
                Ok(message) => Ok(Some((message, length))),
                Err(error) => Err((error, length)),
            },
            Ok(None) if finished => {
                Err((DecodeError::Incomplete { offset: 0, length: bytes.len() }, bytes.len()))
            }
            Ok(None) => Ok(None),
            Err(error @ DecodeError::TooLong { limit, .. }) => Err((error, limit)),
            Err(error) => Err((error, error.offset())),
        }
    }

    /// Reads a whole frame without a DLE in its data, as nearly all are, if no corrupt bytes precede it.
    #[inline]
    fn plain(&mut self) -> Option<ReceivedMessage<M>> {
        let available = self.end - self.start;
        if self.reading.has_begun() || self.skipped > 0 || self.read_before > 0 || available < MIN_LEN {
            return None;
        }
        let data = plain_data(self.buffer.get(self.start..)?, available, self.framing)?;
        let message = M::decode(data, self.framing).ok()?;
        let length = plain_len(data, self.framing);
        self.start += length;
        let (offset, length) = (self.offset(), core::mem::take(&mut self.spare_dles) + length);
        self.position += length as u64;
        Some(ReceivedMessage { offset, length, message })
    }

    #[inline(never)]
    fn next_message(&mut self) -> Option<Result<ReceivedMessage<M>, DecodeError>> {
        if let Some(received) = self.plain() {
            return Some(Ok(received));
        }
        loop {
            if !self.reading.has_begun() {
                let at_mark = self.seek_mark();
                if at_mark && self.read_before > 0 && self.error.is_some() {
                    // Judged by the corrupt frame's own bytes alone, or the cuts of the stream would count.
                    if self.read(self.read_before, false).is_err() {
                        self.skip(1);
                        continue;
                    }
                }
                if (at_mark || self.finished)
                    && let Some(error) = self.take_error()
                {
                    return Some(Err(error));
                }
                if !at_mark {
                    self.finished = false;
                    return None;
                }
            }
            match self.read(self.end - self.start, self.finished) {
                Ok(None) => return None,
                Ok(Some((message, length))) => {
                    let (offset, length) = self.accept(length);
                    return Some(Ok(ReceivedMessage { offset, length, message }));
                }
                Err((error, extent)) => {
                    let at = self.offset().wrapping_add(self.spare_dles).wrapping_sub(self.lent.into());
                    let error = error.shifted(at);
                    (self.error, self.news) = (Some(error), Some(error));
                    self.read_before = self.read_before.max(extent);
                    self.skip(1);
                }
            }
        }
    }

    /// Skips bytes that cannot belong to a start mark. Returns true if `start` is at a mark, false if it is at the beginning
    /// of one or at the end.
    fn seek_mark(&mut self) -> bool {
        let needed = self.framing.leading_dle.count();
        if let Some((mark, [STX, ..])) = self.bytes().split_at_checked(needed)
            && mark.iter().all(|byte| *byte == DLE)
        {
            return true;
        }
        loop {
            let bytes = self.bytes();
            let before = find_dle(bytes);
            let run = bytes.iter().skip(before).take_while(|byte| **byte == DLE).count();
            let next = bytes.get(before + run).copied();
            self.skip(before);
            match next {
                Some(STX) if run >= needed => {
                    self.spare(run - needed);
                    return true;
                }
                Some(_) => self.skip(run),
                None if self.finished => {
                    self.skip(run);
                    return false;
                }
                None => {
                    self.spare(run.saturating_sub(needed));
                    return false;
                }
            }
        }
    }

    /// Skips `count` bytes at `start`, and the DLEs before them: they do not belong to a frame.
    fn skip(&mut self, count: usize) {
        if count > 0 {
            self.skipped += core::mem::take(&mut self.spare_dles) as u64;
            self.skipped += self.consume(count) as u64;
        }
    }

    fn spare(&mut self, dles: usize) {
        self.spare_dles += self.consume(dles);
    }

    #[inline(never)]
    fn push_all(&mut self, bytes: &[u8]) -> usize {
        if bytes.len() > CAPACITY - self.end {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        let taken = bytes.len().min(CAPACITY - self.end);
        let room = self.buffer.get_mut(self.end..self.end + taken);
        if let (Some(room), Some(bytes)) = (room, bytes.get(..taken)) {
            room.copy_from_slice(bytes);
            self.end += taken;
        }
        taken
    }

    /// Removes bytes from the buffer; returns how many of them are not counted yet.
    fn consume(&mut self, count: usize) -> usize {
        self.start += count;
        if self.reading.has_begun() {
            self.reading = Reading::NEW;
        }
        self.read_before = self.read_before.saturating_sub(count);
        count - usize::from(count > 0 && core::mem::take(&mut self.lent))
    }

    /// Removes and returns the error for all skipped bytes.
    fn take_error(&mut self) -> Option<DecodeError> {
        let (offset, skipped) = (self.offset(), core::mem::take(&mut self.skipped));
        let length = whole(skipped);
        self.position += skipped;
        let error = self.error.take();
        (length > 0).then(|| error.unwrap_or(DecodeError::StartMark { offset, length }))
    }

    fn accept(&mut self, length: usize) -> (usize, usize) {
        let offset = self.offset();
        let checksum = self.bytes().get(length - 1);
        let lent = !self.framing.stuffed_checksum && checksum == Some(&DLE);
        let length = core::mem::take(&mut self.spare_dles) + self.consume(length);
        self.position += length as u64;
        if lent {
            self.start -= 1;
            self.read_before = self.read_before.max(1);
            self.lent = true;
        }
        (offset, length)
    }

    /// Returns whether there are no unread bytes from here on, or only half a mark.
    #[inline]
    fn waits(&self, from: usize) -> bool {
        match self.buffer.get(from..self.end) {
            Some([]) => true,
            Some([DLE, ETX]) => self.reading.has_begun(),
            Some([DLE, DLE]) => !self.reading.has_begun(),
            _ => false,
        }
    }

    fn bytes(&self) -> &[u8] {
        self.buffer.get(self.start..self.end).unwrap_or_default()
    }
}

impl<M: Message> robot_session::Decoder for Decoder<M> {
    type Frame<'a>
        = ReceivedMessage<M>
    where
        M: 'a;
    type Error = DecodeError;

    #[inline]
    fn push(&mut self, bytes: &[u8]) -> usize {
        // A port that gives single bytes: no call to copy one.
        if let ([byte], true) = (bytes, self.end < CAPACITY)
            && let Some(room) = self.buffer.get_mut(self.end)
        {
            *room = *byte;
            self.end += 1;
            return 1;
        }
        self.push_all(bytes)
    }

    #[inline]
    fn next_frame(&mut self) -> Option<Result<ReceivedMessage<M>, DecodeError>> {
        let from = self.start + self.reading.at();
        if self.finished {
            return self.next_message();
        }
        // A port that gives single bytes: most of them need no more than a look.
        if self.end == from + 1 {
            let byte = self.buffer.get(from).filter(|byte| **byte != DLE)?;
            if !self.reading.has_begun() {
                self.skip(1);
                return None;
            }
            if self.reading.take(*byte, M::MAX_DATA) {
                return None;
            }
        }
        if self.waits(from) { None } else { self.next_message() }
    }

    fn finish(&mut self) {
        self.finished = true;
    }

    fn position(&self) -> u64 {
        self.position
    }

    fn clear(&mut self) {
        self.position += self.skipped + self.held() as u64;
        (self.start, self.end, self.skipped, self.spare_dles, self.read_before) = (0, 0, 0, 0, 0);
        (self.lent, self.error, self.news, self.finished) = (false, None, None, false);
        self.reading = Reading::NEW;
    }
}

/// Returns the number of bytes as a `usize`, or its maximum if there are more.
fn whole(bytes: u64) -> usize {
    usize::try_from(bytes).unwrap_or(usize::MAX)
}
