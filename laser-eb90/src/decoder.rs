//! Bytes in, frames out; resynchronises after corruption.

use robot_session::StreamBuffer;

use crate::error::DecodeError;
use crate::frame::{Corrupt, Frame, HEAD, MAX_PAYLOAD, Scan, find_head, has_head, in_place, prefix_len};
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
    raw: StreamBuffer<{ Frame::MAX_LEN }>,
    state: State,
    payload: [u8; MAX_PAYLOAD],
}

/// What is known of the bytes that are held.
#[derive(Debug, Clone, Copy, Default)]
struct State {
    /// So many of them begin no head.
    hunted: usize,
    scan: Scan,
    /// No more bytes will come.
    finished: bool,
}

impl State {
    /// The bytes that need not be looked at again.
    #[inline]
    fn read(&self) -> usize {
        if self.scan.is_new() { self.hunted } else { self.scan.read() }
    }

    /// A byte that came alone: whether it is only one more of a payload, or of what has no head.
    #[inline]
    fn passes(&mut self, byte: u8, payload: &mut [u8; MAX_PAYLOAD]) -> bool {
        if !self.scan.is_new() {
            return self.scan.take_byte(byte, payload);
        }
        let passes = byte != HEAD[0] && self.hunted + 1 < MAX_PAYLOAD;
        self.hunted += usize::from(passes);
        passes
    }
}

impl Decoder {
    /// A decoder at offset 0 of a stream.
    pub fn new(profile: &Profile) -> Self {
        let (raw, state) = (StreamBuffer::new(), State::default());
        Self { profile: *profile, raw, state, payload: [0; MAX_PAYLOAD] }
    }

    /// Whether no byte waits for the rest of a frame.
    pub fn is_empty(&self) -> bool {
        self.raw.is_empty()
    }

    #[inline(never)]
    fn next_item(&mut self) -> Option<Result<Frame<'_>, DecodeError>> {
        if self.state.scan.is_new() && !has_head(self.raw.bytes()) {
            return self.hunt().map(Err);
        }
        let raw = self.raw.bytes();
        // Most frames come whole, and without a doubled byte.
        if self.state.scan.is_new()
            && raw.len() >= Frame::MIN_LEN
            && let Some((payload, used)) = in_place(raw, MAX_PAYLOAD, &self.profile)
            && Items::new(payload, &self.profile).check().is_ok()
        {
            let (begin, end) = (prefix_len(&self.profile), payload.len());
            self.state.hunted = 0;
            return Some(Ok(Frame::new(self.raw.take(used).get(begin..begin + end)?, &self.profile)));
        }
        let corrupt = match self.state.scan.advance(raw, &mut self.payload, &self.profile) {
            Ok(None) => return self.incomplete().map(Err),
            Ok(Some(body)) => match Items::new(body.payload(&self.payload), &self.profile).check() {
                Ok(()) => {
                    self.consume(body.used);
                    return Some(Ok(Frame::new(body.payload(&self.payload), &self.profile)));
                }
                // A false head can be followed by the right checksum, but hardly by whole items as well.
                Err(error) => Corrupt { error, examined: body.used },
            },
            Err(corrupt) => corrupt,
        };
        let next = find_head(raw.get(1..corrupt.examined).unwrap_or_default());
        self.consume(1 + next);
        Some(Err(corrupt.error))
    }

    /// Looks for a head, where none is yet.
    fn hunt(&mut self) -> Option<DecodeError> {
        let raw = self.raw.bytes();
        let hunted = self.state.hunted;
        let begin = hunted + find_head(raw.get(hunted..).unwrap_or_default());
        if begin < MAX_PAYLOAD && !has_head(raw.get(begin..).unwrap_or_default()) {
            self.state.hunted = begin;
            return self.incomplete();
        }
        let skipped = begin.min(MAX_PAYLOAD);
        self.consume(skipped);
        Some(DecodeError::NoHead { skipped })
    }

    /// What is held, when no more will come.
    #[inline]
    fn incomplete(&mut self) -> Option<DecodeError> {
        let held = self.raw.len();
        if !self.state.finished || held == 0 {
            return None;
        }
        self.consume(held);
        Some(DecodeError::Incomplete { held })
    }

    fn consume(&mut self, bytes: usize) {
        self.raw.take(bytes);
        (self.state.hunted, self.state.scan) = (0, Scan::default());
    }
}

impl robot_session::Decoder for Decoder {
    type Frame<'a> = Frame<'a>;
    type Error = DecodeError;

    #[inline]
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.state.finished = false;
        self.raw.push(bytes)
    }

    #[inline]
    fn next_frame(&mut self) -> Option<Result<Frame<'_>, DecodeError>> {
        let Self { raw, state, payload, .. } = self;
        if !state.finished && raw.byte_after(state.read()).is_some_and(|byte| state.passes(byte, payload)) {
            return None;
        }
        self.next_item()
    }

    fn finish(&mut self) {
        self.state.finished = true;
    }

    fn position(&self) -> u64 {
        self.raw.position()
    }

    fn clear(&mut self) {
        self.consume(self.raw.len());
    }
}
