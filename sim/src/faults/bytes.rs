//! The faults of a serial line.

/// The probabilities with which a line corrupts a byte, and the generator that decides.
#[derive(Debug, Clone)]
pub struct ByteFaults {
    /// The probability that one bit of a byte is inverted.
    pub flip: f64,
    /// The probability that a byte is lost.
    pub lose: f64,
    /// The probability that a random byte is inserted before a byte.
    pub insert: f64,
    rng: fastrand::Rng,
    count: u64,
}

impl ByteFaults {
    /// Returns a plan without faults.
    pub fn none() -> Self {
        Self::with_rate(0.0, 0)
    }

    /// Creates faults in which each kind has the same probability.
    pub fn with_rate(rate: f64, seed: u64) -> Self {
        Self { flip: rate, lose: rate, insert: rate, rng: fastrand::Rng::with_seed(seed), count: 0 }
    }

    /// Returns the number of faults so far.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Passes the bytes on that arrive for `byte`: none, the byte or another one, or a random byte before it.
    pub fn pass(&mut self, byte: u8, mut out: impl FnMut(u8)) {
        if self.rng.f64() < self.insert {
            self.count += 1;
            out(self.rng.u8(..));
        }
        if self.rng.f64() < self.lose {
            self.count += 1;
        } else if self.rng.f64() < self.flip {
            self.count += 1;
            out(byte ^ 1 << self.rng.u8(0..8));
        } else {
            out(byte);
        }
    }
}
