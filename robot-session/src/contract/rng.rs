//! A seeded generator: the same seed gives the same run on every machine and in every version. And one whose choices are a fuzzer's bytes.

use core::time::Duration;
use std::vec::Vec;

/// Where choices come from.
#[derive(Debug, Clone)]
pub struct Rng(Source);

#[derive(Debug, Clone)]
enum Source {
    /// SplitMix64 (Steele, Lea and Flood, 2014): one `u64` of state, which makes a failing seed easy to pass on.
    Seed(u64),
    /// Bytes, the last first: one for a choice among up to 256, else two. After them every choice is 0.
    Bytes(Vec<u8>),
}

impl Rng {
    /// A generator whose whole sequence follows from `seed`.
    pub fn new(seed: u64) -> Self {
        Self(Source::Seed(seed))
    }

    /// Choices that are these bytes.
    pub fn of(bytes: &[u8]) -> Self {
        Self(Source::Bytes(bytes.iter().rev().copied().collect()))
    }

    /// Whether nothing is left to choose by.
    pub fn is_spent(&self) -> bool {
        matches!(&self.0, Source::Bytes(bytes) if bytes.is_empty())
    }

    /// The next 64 bits.
    pub fn next_u64(&mut self) -> u64 {
        match &mut self.0 {
            Source::Seed(seed) => {
                *seed = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
                let mut z = *seed;
                z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
                z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
                z ^ (z >> 31)
            }
            Source::Bytes(bytes) => u64::from_le_bytes([(); 8].map(|()| bytes.pop().unwrap_or(0))),
        }
    }

    /// A number in `0..bound`; 0 when `bound` is 0.
    pub fn below(&mut self, bound: usize) -> usize {
        match &mut self.0 {
            _ if bound == 0 => 0,
            Source::Bytes(bytes) => {
                let low = bytes.pop().unwrap_or(0);
                let high = if bound > 256 { bytes.pop().unwrap_or(0) } else { 0 };
                usize::from(u16::from_le_bytes([low, high])) % bound
            }
            _ => (self.next_u64() % bound as u64) as usize,
        }
    }

    /// A number in `0.0..1.0`.
    pub fn unit(&mut self) -> f64 {
        match &mut self.0 {
            Source::Bytes(bytes) => f64::from(bytes.pop().unwrap_or(0)) / 256.0,
            Source::Seed(_) => (self.next_u64() >> 11) as f64 / (1u64 << 53) as f64,
        }
    }

    /// A time between `from` and `to`, each order of magnitude equally likely; `from` is above zero.
    pub fn log_uniform(&mut self, from: Duration, to: Duration) -> Duration {
        let ratio = to.as_secs_f64() / from.as_secs_f64();
        from.mul_f64(ratio.powf(self.unit()))
    }

    /// True with probability `p`.
    pub fn chance(&mut self, p: f64) -> bool {
        p > 0.0 && self.unit() < p
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_that_are_bytes_are_spent_with_the_last() {
        let mut choices = Rng::of(&[7, 1, 2]);
        assert_eq!((choices.below(5), choices.is_spent()), (2, false));
        assert_eq!((choices.below(1000), choices.is_spent()), (0x0201, true));
        assert_eq!((choices.below(5), choices.next_u64()), (0, 0));
        assert!(!Rng::new(0).is_spent());
    }

    #[test]
    fn each_order_of_magnitude_is_equally_likely() {
        let mut rng = Rng::new(1);
        let (from, to) = (Duration::from_millis(1), Duration::from_secs(10));
        let times: Vec<_> = (0..4000).map(|_| rng.log_uniform(from, to)).collect();
        assert!(times.iter().all(|time| (from..=to).contains(time)));
        let below = |limit| times.iter().filter(|time| **time < limit).count();
        for (decade, limit) in [10, 100, 1000].map(Duration::from_millis).into_iter().enumerate() {
            assert!(below(limit).abs_diff(1000 * (decade + 1)) < 120, "{}", below(limit));
        }
    }
}
