//! A seeded generator: the same seed gives the same run on every machine and in every version.

use core::time::Duration;
use std::vec::Vec;

/// SplitMix64 (Steele, Lea and Flood, 2014): one `u64` of state, which makes a failing seed easy to pass on.
#[derive(Debug, Clone)]
pub struct Rng(u64);

impl Rng {
    /// Creates a generator whose whole sequence follows from `seed`.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Returns the next 64 bits.
    pub fn next_u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Returns the next `count` bytes.
    pub fn bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count).map(|_| self.next_u64() as u8).collect()
    }

    /// Returns a number in `0..bound`; 0 when `bound` is 0.
    pub fn below(&mut self, bound: usize) -> usize {
        if bound == 0 { 0 } else { (self.next_u64() % bound as u64) as usize }
    }

    /// Returns a number in `0.0..1.0`.
    pub fn unit(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns a time between `from` and `to`, each order of magnitude equally likely; `from` is above zero.
    pub fn log_uniform(&mut self, from: Duration, to: Duration) -> Duration {
        let ratio = to.as_secs_f64() / from.as_secs_f64();
        from.mul_f64(ratio.powf(self.unit()))
    }

    /// Returns true with probability `p`.
    pub fn chance(&mut self, p: f64) -> bool {
        p > 0.0 && self.unit() < p
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
