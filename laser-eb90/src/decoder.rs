//! Bytes in, frames out; resynchronises after corruption.

use robot_session::end::StreamBuffer;

use crate::error::DecodeError;
use crate::frame::{CorruptFrame, Frame, HEAD, MAX_PAYLOAD, Scan, find_head, has_head, in_place, prefix_len};
use crate::items::Items;
use crate::profile::Profile;

/// Cuts a stream into frames: see [`robot_session::Decoder`] for the order of the calls.
///
/// After an error the stream continues at the next head within the bytes that were examined, so a frame after a corrupt one,
/// or after a false head, is not lost. Bytes without a head are one error when a head follows them, or when there are
/// [`MAX_PAYLOAD`] of them. The items of a frame have been read once: its [`Items`] give no error.
#[derive(Debug, Clone)]
pub struct Decoder {
    profile: Profile,
    raw: StreamBuffer<{ Frame::MAX_LEN }>,
    /// The frame that the bytes begin with; new as long as they begin with no head.
    scan: Scan,
    /// The number of these bytes that do not begin a head.
    hunted: usize,
    /// No more bytes will come.
    finished: bool,
    payload: [u8; MAX_PAYLOAD],
}

impl Decoder {
    /// Creates a decoder at offset 0 of a stream.
    pub fn new(profile: &Profile) -> Self {
        let (raw, payload) = (StreamBuffer::new(), [0; MAX_PAYLOAD]);
        Self { profile: *profile, raw, scan: Scan::NEW, hunted: 0, finished: false, payload }
    }

    /// Returns whether no bytes wait for the rest of a frame.
    pub fn is_empty(&self) -> bool {
        self.raw.is_empty()
    }

    /// Returns whether the held bytes begin as a frame does, as far as they go.
    pub(crate) fn has_begun(&self) -> bool {
        let raw = self.raw.bytes();
        !raw.is_empty() && raw.iter().zip(HEAD).all(|(byte, head)| *byte == head)
    }

    #[inline(never)]
    fn next_item(&mut self) -> Option<Result<Frame<'_>, DecodeError>> {
        let raw = self.raw.bytes();
        if self.scan.is_new() {
            if !has_head(raw) {
                return self.hunt().map(Err);
            }
            // Most frames come whole, and without a doubled byte.
            if raw.len() >= Frame::MIN_LEN
                && let Some((payload, used)) = in_place(raw, MAX_PAYLOAD, &self.profile)
                && Items::new(payload, &self.profile).check().is_ok()
            {
                let (begin, end) = (prefix_len(&self.profile), payload.len());
                self.hunted = 0;
                return Some(Ok(Frame::new(self.raw.take(used).get(begin..begin + end)?, &self.profile)));
            }
        }
        let corrupt = match self.scan.advance(raw, &mut self.payload, &self.profile) {
            Ok(None) => return self.wait().map(Err),
            Ok(Some(body)) => match Items::new(body.payload(&self.payload), &self.profile).check() {
                Ok(()) => {
                    self.consume(body.used);
                    return Some(Ok(Frame::new(body.payload(&self.payload), &self.profile)));
                }
                // A false head can be followed by the right checksum, but hardly by whole items as well.
                Err(error) => CorruptFrame { error, examined: body.used },
            },
            Err(corrupt) => corrupt,
        };
        let next = find_head(raw.get(1..corrupt.examined).unwrap_or_default());
        self.consume(1 + next);
        Some(Err(corrupt.error))
    }

    /// Searches for a head, unless one was found.
    fn hunt(&mut self) -> Option<DecodeError> {
        let raw = self.raw.bytes();
        let hunted = self.hunted;
        let begin = hunted + find_head(raw.get(hunted..).unwrap_or_default());
        if begin < MAX_PAYLOAD && !has_head(raw.get(begin..).unwrap_or_default()) {
            self.hunted = begin;
            return self.wait();
        }
        let skipped = begin.min(MAX_PAYLOAD);
        self.consume(skipped);
        Some(DecodeError::NoHead { skipped })
    }

    /// Waits for another byte. When no more will come, the bytes that are held are an error.
    #[inline]
    fn wait(&mut self) -> Option<DecodeError> {
        let held = self.raw.len();
        if !self.finished || held == 0 {
            return None;
        }
        self.consume(held);
        Some(DecodeError::Incomplete { held })
    }

    fn consume(&mut self, bytes: usize) {
        self.raw.take(bytes);
        (self.scan, self.hunted) = (Scan::NEW, 0);
    }
}

impl robot_session::Decoder for Decoder {
    type Frame<'a> = Frame<'a>;
    type Error = DecodeError;

    #[inline]
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.finished &= bytes.is_empty();
        self.raw.push(bytes)
    }

    #[inline]
    fn next_frame(&mut self) -> Option<Result<Frame<'_>, DecodeError>> {
        if self.raw.is_empty() { None } else { self.next_item() }
    }

    fn finish(&mut self) {
        self.finished = true;
    }

    fn position(&self) -> u64 {
        self.raw.position()
    }

    fn clear(&mut self) {
        self.consume(self.raw.len());
    }
}
