//! Bytes in, messages out; finds its feet again after damage.

use core::marker::PhantomData;

use crate::frame::{DLE, STX, find_dle};
use crate::message::Message;
use crate::{DecodeError, Frame, Framing};

/// A message and where its frame stood.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Received<M> {
    /// The frame's first byte, counted from the first byte that the decoder was given; wraps with `usize`.
    pub offset: usize,
    /// The frame's length on the line.
    pub length: usize,
    /// What it says.
    pub message: M,
}

/// Finds the messages of one side ([`RobotMessage`](crate::RobotMessage) or [`HostMessage`](crate::HostMessage)) in a
/// stream.
///
/// [`push`](Decoder::push) bytes, then call [`next_frame`](Decoder::next_frame) until it gives `None`, and push the rest if
/// not all were taken: then there is room. When the line falls silent in the middle of a frame, or ends, call
/// [`finish`](Decoder::finish) before that.
///
/// The start mark is not unique: data `10 02` is doubled to `10 10 02`. When a frame is cut off, the next one looks like
/// its data, and both would be lost. So when a frame turns out to be damaged, only the first byte of its start mark is
/// given up, and the rest of its *raw* bytes is searched again. A frame is consumed only once its marks, its checksum and
/// its message are right; one that was found among the bytes of a damaged frame must also name only codes that the source
/// names ([`Message::is_plausible`]). The work is bounded: a byte is looked at once for each start mark in the
/// [`Frame::MAX_LEN`] bytes before it.
///
/// Each stretch of damage gives one error, as soon as it is certain: a host has to ask again within the window. How far the
/// damage reaches shows when the next message comes, in its [`offset`](Received::offset).
#[derive(Debug, Clone)]
pub struct Decoder<M> {
    framing: Framing,
    buffer: [u8; CAPACITY],
    start: usize,
    end: usize,
    /// The stream offset of `buffer[start]`.
    offset: usize,
    /// The bytes from `start` on that have been read already: a frame that begins among them is a second reading.
    read_before: usize,
    /// What is wrong with them, or directly behind them, is the same damage.
    silenced: bool,
    /// Bytes in front of `start` that belong to no frame and are not reported yet, and where they begin.
    noise: usize,
    noise_offset: usize,
    /// DLEs between them and `start`: noise, unless a start mark follows.
    spare_dles: usize,
    finished: bool,
    side: PhantomData<M>,
}

const CAPACITY: usize = 2 * Frame::MAX_LEN;

impl<M: Message> Decoder<M> {
    /// A decoder at the beginning of a stream.
    pub fn new(framing: Framing) -> Self {
        Self {
            framing,
            buffer: [0; CAPACITY],
            start: 0,
            end: 0,
            offset: 0,
            read_before: 0,
            silenced: false,
            noise: 0,
            noise_offset: 0,
            spare_dles: 0,
            finished: false,
            side: PhantomData,
        }
    }

    /// Takes as many of `bytes` as there is room for, and returns how many.
    pub fn push(&mut self, bytes: &[u8]) -> usize {
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

    /// The next message, or the next stretch of damage. `None`: more bytes are needed.
    pub fn next_frame(&mut self) -> Option<Result<Received<M>, DecodeError>> {
        loop {
            let at_mark = self.seek_mark();
            if (at_mark || self.finished)
                && let Some(noise) = self.take_noise()
            {
                return Some(Err(noise));
            }
            if !at_mark {
                self.finished = false;
                return None;
            }
            let second_reading = self.read_before > 0;
            self.silenced &= second_reading;
            match self.read(second_reading) {
                Ok(None) => return None,
                Ok(Some((message, length))) => {
                    let offset = self.offset;
                    self.consume_frame(length);
                    return Some(Ok(Received { offset, length, message }));
                }
                Err((error, extent)) => {
                    let error = error.shifted(self.offset);
                    let news = !core::mem::replace(&mut self.silenced, true);
                    self.read_before = self.read_before.max(extent);
                    self.consume(1);
                    if news {
                        return Some(Err(error));
                    }
                }
            }
        }
    }

    /// Says that nothing will follow the bytes pushed so far: until `next_frame` next gives `None`, a frame that is not
    /// complete is damage, and what is left of it is searched for complete ones.
    pub fn finish(&mut self) {
        self.finished = true;
    }

    /// The number of bytes that wait for more.
    pub fn pending(&self) -> usize {
        self.end - self.start
    }

    /// Drops the bytes that wait. Offsets count on.
    pub fn clear(&mut self) {
        self.consume(self.pending());
        (self.read_before, self.noise, self.spare_dles) = (0, 0, 0);
        (self.silenced, self.finished) = (false, false);
    }

    /// Reads the frame at `start`. An error comes with the number of bytes that it is about.
    fn read(&self, second_reading: bool) -> Result<Option<(M, usize)>, (DecodeError, usize)> {
        let bytes = self.bytes();
        match Frame::decode_limited(bytes, self.framing, M::MAX_DATA) {
            Ok(Some((frame, length))) => match M::decode(frame.data(), self.framing) {
                Ok(message) if second_reading && !message.is_plausible() => {
                    Err((DecodeError::Length { offset: 0, found: frame.data().len() }, length))
                }
                Ok(message) => Ok(Some((message, length))),
                Err(error) => Err((error, length)),
            },
            Ok(None) if self.finished => {
                Err((DecodeError::Incomplete { offset: 0, length: bytes.len() }, bytes.len()))
            }
            Ok(None) => Ok(None),
            Err(error @ DecodeError::TooLong { limit, .. }) => Err((error, limit)),
            Err(error) => Err((error, error.offset())),
        }
    }

    /// Drops what cannot belong to a start mark. True: `start` is at one; false: at its beginning or at the end.
    fn seek_mark(&mut self) -> bool {
        let needed = self.framing.leading_dle.count();
        loop {
            let bytes = self.bytes();
            let before = find_dle(bytes);
            let run = bytes.iter().skip(before).take_while(|byte| **byte == DLE).count();
            let behind = bytes.get(before + run).copied();
            self.drop_noise(before);
            match behind {
                Some(STX) if run >= needed => {
                    self.consume(run - needed);
                    self.spare_dles = 0;
                    return true;
                }
                Some(_) => self.drop_noise(run),
                None if self.finished => {
                    self.drop_noise(run);
                    return false;
                }
                None => {
                    let spare = run.saturating_sub(needed);
                    self.spare_dles += spare.saturating_sub(self.read_before);
                    self.consume(spare);
                    return false;
                }
            }
        }
    }

    fn drop_noise(&mut self, count: usize) {
        if count > 0 {
            let spare = core::mem::take(&mut self.spare_dles);
            let known = count.min(self.read_before);
            if !self.silenced {
                if self.noise == 0 {
                    self.noise_offset = self.offset.wrapping_add(known).wrapping_sub(spare);
                }
                self.noise += spare + count - known;
            }
            self.consume(count);
        }
    }

    fn take_noise(&mut self) -> Option<DecodeError> {
        let length = core::mem::take(&mut self.noise);
        (length > 0).then_some(DecodeError::StartMark { offset: self.noise_offset, length })
    }

    /// Consumes a good frame, but for a checksum of DLE: when the checksum was lost, that is the next frame's first byte.
    fn consume_frame(&mut self, length: usize) {
        let borrowed = usize::from(
            !self.framing.stuffed_checksum && self.bytes().get(length - 1).is_some_and(|byte| *byte == DLE),
        );
        self.consume(length - borrowed);
        self.read_before = self.read_before.max(borrowed);
        self.silenced = false;
    }

    fn consume(&mut self, count: usize) {
        self.start += count;
        self.offset = self.offset.wrapping_add(count);
        self.read_before = self.read_before.saturating_sub(count);
    }

    fn bytes(&self) -> &[u8] {
        self.buffer.get(self.start..self.end).unwrap_or_default()
    }
}
