//! Bytes in, frames out; finds its feet again after damage.

use crate::error::DecodeError;
use crate::frame::{Damage, Frame, MAX_PAYLOAD, Scan, find_head, has_head};
use crate::message::Items;
use crate::profile::Profile;

/// Cuts a stream into frames.
///
/// Call [`push`](Self::push) with what was read, then [`next_frame`](Self::next_frame) until it gives `None`; push the
/// rest when `push` did not take everything. At the end of the stream, or when the line has fallen silent, call
/// [`finish`](Self::finish) and `next_frame` again. The same bytes give the same frames and errors however they are cut.
///
/// After an error the stream goes on at the next head within the bytes that were looked at, so a frame behind a damaged
/// one, or behind a false head, is not lost. The items of a frame have been read over once: its [`Items`] give no error.
/// Every byte belongs to exactly one frame or error:
/// [`position`](Self::position) says where each ends.
#[derive(Debug, Clone)]
pub struct Decoder {
    profile: Profile,
    raw: [u8; Frame::MAX_LEN],
    start: usize,
    end: usize,
    /// Bytes from `start` on that begin no head.
    hunted: usize,
    scan: Scan,
    payload: [u8; MAX_PAYLOAD],
    position: u64,
    finished: bool,
}

impl Decoder {
    /// A decoder at offset 0 of a stream.
    pub fn new(profile: &Profile) -> Self {
        Self {
            profile: *profile,
            raw: [0; Frame::MAX_LEN],
            start: 0,
            end: 0,
            hunted: 0,
            scan: Scan::default(),
            payload: [0; MAX_PAYLOAD],
            position: 0,
            finished: false,
        }
    }

    /// Takes bytes; returns how many. When it takes none, its buffer is full and `next_frame` has something to give.
    pub fn push(&mut self, bytes: &[u8]) -> usize {
        if self.raw.len() - self.end < bytes.len() {
            self.raw.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        let room = self.raw.get_mut(self.end..).unwrap_or_default();
        let taken = room.len().min(bytes.len());
        if let (Some(slot), Some(bytes)) = (room.get_mut(..taken), bytes.get(..taken)) {
            slot.copy_from_slice(bytes);
        }
        self.end += taken;
        self.finished = false;
        taken
    }

    /// The next frame or error; `None` when more bytes are needed.
    ///
    /// Bytes without a head are one error when a head follows them, or when there are [`MAX_PAYLOAD`] of them.
    pub fn next_frame(&mut self) -> Option<Result<Frame<'_>, DecodeError>> {
        let held = self.raw.get(self.start..self.end).unwrap_or_default();
        if self.scan.is_new() && !has_head(held) {
            let begin = self.hunted + find_head(held.get(self.hunted..).unwrap_or_default());
            if begin < MAX_PAYLOAD && !has_head(held.get(begin..).unwrap_or_default()) {
                self.hunted = begin;
                return self.incomplete();
            }
            let skipped = begin.min(MAX_PAYLOAD);
            self.consume(skipped);
            return Some(Err(DecodeError::NoHead { skipped }));
        }
        let found = self.scan.advance(held, &mut self.payload, &self.profile).and_then(|found| {
            let Some((len, used)) = found else { return Ok(None) };
            // A false head can be followed by the right checksum, but hardly by whole items as well.
            let payload = self.payload.get(..len).unwrap_or_default();
            match Items::new(payload, &self.profile).check() {
                Ok(()) => Ok(found),
                Err(error) => Err(Damage { error, examined: used }),
            }
        });
        match found {
            Ok(None) => self.incomplete(),
            Ok(Some((len, used))) => {
                self.consume(used);
                Some(Ok(Frame::new(self.payload.get(..len).unwrap_or_default(), &self.profile)))
            }
            Err(damage) => {
                let next = find_head(held.get(1..damage.examined).unwrap_or_default());
                self.consume(1 + next);
                Some(Err(damage.error))
            }
        }
    }

    /// Says that the line fell silent or the input ended: what is held is no whole frame, and `next_frame` gives it as
    /// [`DecodeError::Incomplete`] when nothing else is left.
    pub fn finish(&mut self) {
        self.finished = true;
    }

    /// Forgets what is held.
    pub(crate) fn clear(&mut self) {
        self.consume(self.end - self.start);
    }

    /// Whether no byte waits for the rest of a frame.
    pub fn is_empty(&self) -> bool {
        self.start == self.end
    }

    /// The stream offset just behind what was returned last.
    pub fn position(&self) -> u64 {
        self.position
    }

    fn incomplete(&mut self) -> Option<Result<Frame<'_>, DecodeError>> {
        let held = self.end - self.start;
        if !self.finished || held == 0 {
            return None;
        }
        self.clear();
        Some(Err(DecodeError::Incomplete { held }))
    }

    fn consume(&mut self, bytes: usize) {
        self.start += bytes;
        self.position += bytes as u64;
        self.hunted = 0;
        self.scan = Scan::default();
    }
}
