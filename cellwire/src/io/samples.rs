//! Measured times.

use std::time::Duration;

use hdrhistogram::Histogram;

/// Times from 1 µs to an hour, in constant memory, with a precision of three digits.
#[derive(Debug, Clone)]
pub struct Samples(Histogram<u64>);

impl Default for Samples {
    fn default() -> Self {
        #[expect(clippy::expect_used, reason = "the bounds are constants in order")]
        Self(Histogram::new_with_bounds(1, 3_600_000_000, 3).expect("1 µs to 1 h"))
    }
}

impl Samples {
    /// Adds one; a time out of range counts as the nearest bound.
    pub fn add(&mut self, time: Duration) {
        self.0.saturating_record(u64::try_from(time.as_micros()).unwrap_or(u64::MAX).max(1));
    }

    /// Adds those of another.
    pub fn merge(&mut self, other: &Self) {
        self.0 += &other.0;
    }

    /// Returns the number of samples.
    pub fn count(&self) -> u64 {
        self.0.len()
    }

    /// Returns the time that this share of the samples does not exceed; zero without samples.
    pub fn at(&self, quantile: f64) -> Duration {
        Duration::from_micros(self.0.value_at_quantile(quantile))
    }

    /// Returns the p99, or the fourth longest if that is less.
    pub fn judged(&self) -> Duration {
        // The half prevents that rounding selects a neighbouring sample.
        self.at((1.0 - 3.5 / self.count() as f64).clamp(0.0, 0.99))
    }

    /// Returns the longest.
    pub fn max(&self) -> Duration {
        Duration::from_micros(self.0.max())
    }
}
