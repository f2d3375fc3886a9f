//! Bytes in, frames out; resynchronises after corruption.

use robot_session::StreamBuffer;

use crate::error::DecodeError;
use crate::frame::{
    Corrupt, Frame, HEAD, MARK, MAX_PAYLOAD, Scan, find_head, has_head, in_place, prefix_len,
};
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
#[derive(Debug, Clone, Copy)]
struct State {
    /// The frame that they begin with; new as long as they begin with no head.
    scan: Scan,
    /// With fewer bytes there is nothing to give yet.
    needed: usize,
    /// A byte that comes alone then changes nothing, if this is another one …
    awaited: u8,
    /// … and fewer bytes than these are held.
    pass_below: u16,
    /// No more bytes will come.
    finished: bool,
}

impl State {
    /// Nothing is held: the last byte of a head is awaited.
    const EMPTY: Self =
        Self { scan: Scan::NEW, needed: 1, awaited: HEAD[2], pass_below: MOST, finished: false };
}

/// Fewer bytes are no frame that is too long, and no whole error without a head.
const MOST: u16 = 512;
const _: () = assert!(MOST as usize == MAX_PAYLOAD);

impl Decoder {
    /// A decoder at offset 0 of a stream.
    pub fn new(profile: &Profile) -> Self {
        Self { profile: *profile, raw: StreamBuffer::new(), state: State::EMPTY, payload: [0; MAX_PAYLOAD] }
    }

    /// Whether no byte waits for the rest of a frame.
    pub fn is_empty(&self) -> bool {
        self.raw.is_empty()
    }

    /// Whether what is held begins as a frame does, as far as it goes.
    pub(crate) fn has_begun(&self) -> bool {
        let raw = self.raw.bytes();
        !raw.is_empty() && raw.iter().zip(HEAD).all(|(byte, head)| *byte == head)
    }

    /// Whether the last byte came alone, and is only one more of a payload, or of what has no head.
    #[inline]
    fn passes(&mut self) -> bool {
        let state = &mut self.state;
        let Some(byte) = self.raw.byte_after(state.needed - 1) else { return false };
        if byte == state.awaited || state.needed >= state.pass_below.into() {
            return false;
        }
        state.needed += 1;
        true
    }

    #[inline(never)]
    fn next_item(&mut self) -> Option<Result<Frame<'_>, DecodeError>> {
        let raw = self.raw.bytes();
        if self.state.scan.is_new() {
            if !has_head(raw) {
                return self.hunt().map(Err);
            }
            // Most frames come whole, and without a doubled byte.
            if raw.len() >= Frame::MIN_LEN
                && let Some((payload, used)) = in_place(raw, MAX_PAYLOAD, &self.profile)
                && Items::new(payload, &self.profile).check().is_ok()
            {
                let (begin, end) = (prefix_len(&self.profile), payload.len());
                self.state = State { finished: self.state.finished, ..State::EMPTY };
                return Some(Ok(Frame::new(self.raw.take(used).get(begin..begin + end)?, &self.profile)));
            }
        }
        let corrupt = match self.state.scan.advance(raw, &mut self.payload, &self.profile) {
            Ok(None) => {
                // What is held may end in the middle of a mark.
                let passes = self.state.scan.read() == raw.len();
                return self.wait(MARK, if passes { MOST } else { 0 }).map(Err);
            }
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
        // A head that began before was whole before.
        let hunted = self.state.needed.saturating_sub(HEAD.len());
        let begin = hunted + find_head(raw.get(hunted..).unwrap_or_default());
        if begin < MAX_PAYLOAD && !has_head(raw.get(begin..).unwrap_or_default()) {
            return self.wait(HEAD[2], MOST);
        }
        let skipped = begin.min(MAX_PAYLOAD);
        self.consume(skipped);
        Some(DecodeError::NoHead { skipped })
    }

    /// Waits for another byte; what is held is an error when no more will come.
    #[inline]
    fn wait(&mut self, awaited: u8, pass_below: u16) -> Option<DecodeError> {
        let held = self.raw.len();
        if !self.state.finished {
            self.state = State { needed: held + 1, awaited, pass_below, ..self.state };
            return None;
        }
        self.consume(held);
        if held == 0 { None } else { Some(DecodeError::Incomplete { held }) }
    }

    fn consume(&mut self, bytes: usize) {
        self.raw.take(bytes);
        self.state = State { finished: self.state.finished, ..State::EMPTY };
    }
}

impl robot_session::Decoder for Decoder {
    type Frame<'a> = Frame<'a>;
    type Error = DecodeError;

    #[inline]
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.state.finished &= bytes.is_empty();
        self.raw.push(bytes)
    }

    #[inline]
    fn next_frame(&mut self) -> Option<Result<Frame<'_>, DecodeError>> {
        let waits = !self.state.finished && (self.raw.len() < self.state.needed || self.passes());
        if waits { None } else { self.next_item() }
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
