//! Streams through a decoder, whole or one byte a push.

use std::hint::black_box;
use std::slice;

use benches::{Count, Ratio};
use robot_session::Decoder;

pub const VALID: &str = "a valid stream, one byte a push";
pub const RANDOM: &str = "random bytes, one byte a push";
pub const RANDOM_WHOLE: &str = "random bytes";
pub const WORST: &str = "the worst noise, one byte a push";
pub const WORST_WHOLE: &str = "the worst noise";

/// The goals of noise, one byte a push.
pub const RATIOS: &[Ratio] = &[
    Ratio { what: RANDOM, times: 3.0, of: &[RANDOM_WHOLE] },
    Ratio { what: WORST, times: 3.0, of: &[WORST_WHOLE] },
];

/// One byte a push, `units` of them a round.
pub const fn valid(units: f64, run: fn(u64)) -> Count {
    Count { what: VALID, goal: Some(60.0), units, unit: "byte", run }
}

/// A stream of [`NOISE`] bytes.
pub const fn noisy(what: &'static str, run: fn(u64)) -> Count {
    Count { what, goal: None, units: NOISE as f64, unit: "byte", run }
}

/// The same, one byte a push: three times as much, or as much as a valid stream where that is more.
pub const fn noisy_bytes(what: &'static str, run: fn(u64)) -> Count {
    Count { goal: Some(60.0), ..noisy(what, run) }
}

/// The bytes of a stream of noise.
pub const NOISE: usize = 1024;

/// Random bytes, the same ones each time.
pub fn noise() -> Vec<u8> {
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

/// Gives a decoder the same stream again and again, one byte a push; `frames` is how many each of them holds.
pub fn push<D: Decoder>(rounds: u64, mut decoder: D, stream: &[u8], frames: usize) {
    for _ in 0..rounds {
        assert_eq!(feed(&mut decoder, stream.iter().map(slice::from_ref)), frames);
    }
}

/// Gives a decoder noise, one byte a push, whatever it finds in it.
pub fn push_noise<D: Decoder>(rounds: u64, mut decoder: D, noise: &[u8]) {
    assert_eq!(noise.len(), NOISE);
    for _ in 0..rounds {
        black_box(feed(&mut decoder, noise.iter().map(slice::from_ref)));
    }
}

/// The same, but as much of it a push as the decoder takes.
pub fn push_whole<D: Decoder>(rounds: u64, mut decoder: D, noise: &[u8]) {
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

/// This, over and over.
pub fn repeated(pattern: &[u8]) -> Vec<u8> {
    pattern.iter().copied().cycle().take(NOISE).collect()
}

/// The least that a byte a push can cost: what `push` and `next_frame` take of a decoder that only keeps the byte and looks at it.
pub const LIMIT: Count = noisy("… by hand: each byte kept and compared", |rounds| {
    push_noise(rounds, ByHand { bytes: [0; 64], length: 0 }, &noise());
});

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
