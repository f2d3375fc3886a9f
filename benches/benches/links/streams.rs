//! Streams through a decoder: valid frames in one piece and one byte a push, and noise.

use std::hint::black_box;
use std::slice;

use benches::{Count, Stream};
use robot_session::Decoder;

/// A decoder, and the streams that it is given.
pub(super) trait Decoding {
    type Decoder: Decoder;

    /// The bytes of [`valid`](Self::valid).
    const LEN: usize;
    /// The frames in it.
    const FRAMES: usize;
    const NAMES: Names = NAMES;

    fn decoder() -> Self::Decoder;

    /// Returns a stream of whole frames.
    fn valid() -> Vec<u8>;

    /// Returns [`NOISE`] bytes that cost the decoder more than others.
    fn worst() -> Vec<u8>;
}

/// The names of the rows.
pub(super) struct Names {
    /// The work in a report of times.
    pub(super) work: &'static str,
    pub(super) whole: &'static str,
    pub(super) bytes: &'static str,
    pub(super) by_hand: &'static str,
    pub(super) random: &'static str,
    pub(super) worst: &'static str,
}

/// The names of a link with one decoder.
pub(super) const NAMES: Names = Names {
    work: "decoder",
    whole: "a valid stream in one piece",
    bytes: "a valid stream, one byte a push",
    by_hand: "… by hand: each byte kept and compared",
    random: "random bytes",
    worst: "the worst noise",
};

/// Returns the rows of a decoder.
pub(super) const fn rows<D: Decoding>() -> Stream {
    let Names { work, whole, bytes, by_hand, random, worst } = D::NAMES;
    [
        Count::byte(whole, D::LEN, push_whole::<D>).timed(work, "in one piece"),
        Count::byte(bytes, D::LEN, push_bytes::<D>).timed(work, "byte by byte"),
        Count::byte(by_hand, D::LEN, push_by_hand::<D>).timed(work, "byte by byte, by hand"),
        Count::byte(random, NOISE, |rounds| push_noise::<D>(rounds, &noise())),
        Count::byte(worst, NOISE, |rounds| push_noise::<D>(rounds, &D::worst())),
    ]
}

/// The bytes of a stream of noise.
pub(super) const NOISE: usize = 1024;

/// Returns random bytes, the same ones each time.
fn noise() -> Vec<u8> {
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut byte = || {
        // xorshift64, whose upper bits are the better ones.
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state.to_be_bytes()[0]
    };
    (0..NOISE).map(|_| byte()).collect()
}

/// Returns noise of this pattern.
pub(super) fn repeated(pattern: &[u8]) -> Vec<u8> {
    pattern.iter().copied().cycle().take(NOISE).collect()
}

/// Gives a decoder the same stream again and again, as much of it a push as it takes.
fn push_whole<D: Decoding>(rounds: u64) {
    let (mut decoder, stream) = (D::decoder(), valid::<D>());
    for _ in 0..rounds {
        assert_eq!(feed(&mut decoder, [&*stream].into_iter()), D::FRAMES);
    }
}

/// Pushes the same bytes, one byte per push.
fn push_bytes<D: Decoding>(rounds: u64) {
    let (mut decoder, stream) = (D::decoder(), valid::<D>());
    for _ in 0..rounds {
        assert_eq!(feed(&mut decoder, stream.iter().map(slice::from_ref)), D::FRAMES);
    }
}

/// Stores and compares each of the same bytes: the least cost of a decoder with one byte per push.
fn push_by_hand<D: Decoding>(rounds: u64) {
    let (mut decoder, stream) = (ByHand { bytes: [0; 64], length: 0 }, valid::<D>());
    for _ in 0..rounds {
        black_box(feed(&mut decoder, stream.iter().map(slice::from_ref)));
    }
}

fn valid<D: Decoding>() -> Vec<u8> {
    let stream = D::valid();
    assert_eq!(stream.len(), D::LEN);
    stream
}

/// Gives a decoder noise, whatever it finds in it.
fn push_noise<D: Decoding>(rounds: u64, noise: &[u8]) {
    assert_eq!(noise.len(), NOISE);
    let mut decoder = D::decoder();
    for _ in 0..rounds {
        black_box(feed(&mut decoder, [noise].into_iter()));
    }
}

fn feed<'a, D: Decoder>(decoder: &mut D, pieces: impl Iterator<Item = &'a [u8]>) -> usize {
    let mut found = 0;
    for mut rest in black_box(pieces) {
        while !rest.is_empty() {
            rest = &rest[decoder.push(rest)..];
            while let Some(frame) = decoder.next_frame() {
                found += usize::from(black_box(frame).is_ok());
            }
        }
    }
    found
}

struct ByHand {
    bytes: [u8; 64],
    length: usize,
}

impl Decoder for ByHand {
    type Frame<'a> = &'a [u8];
    type Error = core::fmt::Error;

    fn push(&mut self, bytes: &[u8]) -> usize {
        match (bytes, self.bytes.get_mut(self.length)) {
            ([byte, ..], Some(slot)) => {
                *slot = *byte;
                self.length += 1;
                1
            }
            _ => 0,
        }
    }

    fn next_frame(&mut self) -> Option<Result<&[u8], core::fmt::Error>> {
        let last = self.bytes.get(self.length.checked_sub(1)?)?;
        let is_whole = *last == b'\n';
        if !is_whole && self.length < self.bytes.len() {
            return None;
        }
        let length = core::mem::take(&mut self.length);
        Some(if is_whole { Ok(&self.bytes[..length]) } else { Err(core::fmt::Error) })
    }

    fn finish(&mut self) {}

    fn position(&self) -> u64 {
        0
    }

    fn clear(&mut self) {}
}
