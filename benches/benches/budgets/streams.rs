//! Streams through a decoder, whole or one byte a push.

use std::hint::black_box;

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

/// Gives a decoder the same stream again and again, in pieces of this length; `frames` is how many each of them holds.
pub fn push<D: Decoder>(rounds: u64, mut decoder: D, stream: &[u8], piece: usize, frames: usize) {
    for _ in 0..rounds {
        assert_eq!(feed(&mut decoder, stream, piece), frames);
    }
}

fn feed<D: Decoder>(decoder: &mut D, stream: &[u8], piece: usize) -> usize {
    let mut found = 0;
    for mut rest in black_box(stream).chunks(piece) {
        while !rest.is_empty() {
            rest = &rest[decoder.push(rest)..];
            while let Some(frame) = decoder.next_frame() {
                found += usize::from(black_box(frame).is_ok());
            }
        }
    }
    found
}

/// Gives a decoder noise, in pieces of this length, whatever it finds in it.
pub fn push_noise<D: Decoder>(rounds: u64, mut decoder: D, noise: &[u8], piece: usize) {
    assert_eq!(noise.len(), NOISE);
    for _ in 0..rounds {
        black_box(feed(&mut decoder, noise, piece));
    }
}

/// This, over and over.
pub fn repeated(pattern: &[u8]) -> Vec<u8> {
    pattern.iter().copied().cycle().take(NOISE).collect()
}
