//! Bytes in, frames out; resynchronises after corruption.

use crate::error::DecodeError;
use crate::frame::{Body, Corrupt, Frame, MAX_PAYLOAD, Scan, find_head, has_head};
use crate::items::Items;
use crate::profile::Profile;

/// Cuts a stream into frames: see [`robot_session::Decoder`] for the order of the calls.
///
/// After an error the stream goes on at the next head within the bytes that were examined, so a frame after a corrupt one, or
/// after a false head, is not lost. Bytes without a head are one error when a head follows them, or when there are
/// [`MAX_PAYLOAD`] of them. The items of a frame have been read once: its [`Items`] give no error.
#[derive(Debug, Clone)]
pub struct Decoder {
    profile: Profile,
    raw: [u8; Frame::MAX_LEN],
    held: Held,
    payload: [u8; MAX_PAYLOAD],
}

/// Which of the raw bytes are held, and what is known of them.
#[derive(Debug, Clone, Copy, Default)]
struct Held {
    start: usize,
    end: usize,
    /// Bytes from `start` on that begin no head.
    hunted: usize,
    scan: Scan,
    /// The stream offset of `start`.
    position: u64,
    /// No more bytes will come.
    finished: bool,
}

impl Decoder {
    /// A decoder at offset 0 of a stream.
    pub fn new(profile: &Profile) -> Self {
        Self { profile: *profile, raw: [0; Frame::MAX_LEN], held: Held::default(), payload: [0; MAX_PAYLOAD] }
    }

    /// Whether no byte waits for the rest of a frame.
    pub fn is_empty(&self) -> bool {
        self.held.len() == 0
    }
}

impl robot_session::Decoder for Decoder {
    type Frame<'a> = Frame<'a>;
    type Error = DecodeError;

    fn push(&mut self, bytes: &[u8]) -> usize {
        let held = &mut self.held;
        if self.raw.len() - held.end < bytes.len() {
            self.raw.copy_within(held.start..held.end, 0);
            held.end -= held.start;
            held.start = 0;
        }
        let room = self.raw.get_mut(held.end..).unwrap_or_default();
        let taken = room.len().min(bytes.len());
        if let (Some(slot), Some(bytes)) = (room.get_mut(..taken), bytes.get(..taken)) {
            slot.copy_from_slice(bytes);
        }
        held.end += taken;
        held.finished = false;
        taken
    }

    fn next_frame(&mut self) -> Option<Result<Frame<'_>, DecodeError>> {
        let held = &mut self.held;
        let raw = self.raw.get(held.start..held.end).unwrap_or_default();
        if held.scan.is_new() && !has_head(raw) {
            let begin = held.hunted + find_head(raw.get(held.hunted..).unwrap_or_default());
            if begin < MAX_PAYLOAD && !has_head(raw.get(begin..).unwrap_or_default()) {
                held.hunted = begin;
                return held.incomplete().map(Err);
            }
            let skipped = begin.min(MAX_PAYLOAD);
            held.consume(skipped);
            return Some(Err(DecodeError::NoHead { skipped }));
        }
        let corrupt = match held.scan.advance(raw, &mut self.payload, &self.profile) {
            Ok(None) => return held.incomplete().map(Err),
            Ok(Some(body)) => match check(body, raw, &self.payload, &self.profile) {
                Ok(frame) => {
                    held.consume(body.used);
                    return Some(Ok(frame));
                }
                Err(corrupt) => corrupt,
            },
            Err(corrupt) => corrupt,
        };
        let next = find_head(raw.get(1..corrupt.examined).unwrap_or_default());
        held.consume(1 + next);
        Some(Err(corrupt.error))
    }

    fn finish(&mut self) {
        self.held.finished = true;
    }

    fn position(&self) -> u64 {
        self.held.position
    }

    fn clear(&mut self) {
        self.held.consume(self.held.len());
    }
}

impl Held {
    fn len(&self) -> usize {
        self.end - self.start
    }

    /// What is held, when no more will come.
    fn incomplete(&mut self) -> Option<DecodeError> {
        let held = self.len();
        if !self.finished || held == 0 {
            return None;
        }
        self.consume(held);
        Some(DecodeError::Incomplete { held })
    }

    fn consume(&mut self, bytes: usize) {
        self.start += bytes;
        self.position += bytes as u64;
        self.hunted = 0;
        self.scan = Scan::default();
    }
}

/// The frame, if it has whole items: a false head can be followed by the right checksum, but hardly by both.
fn check<'a>(body: Body, raw: &'a [u8], copied: &'a [u8], profile: &Profile) -> Result<Frame<'a>, Corrupt> {
    let payload = body.payload(raw, copied);
    match Items::new(payload, profile).check() {
        Ok(()) => Ok(Frame::new(payload, profile)),
        Err(error) => Err(Corrupt { error, examined: body.used }),
    }
}
