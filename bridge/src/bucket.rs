//! A token bucket: `burst` tokens at once, and `per_second` new ones each second.

/// The rate of commands that a cell takes.
#[derive(Debug, Clone, Copy)]
pub struct Rate {
    /// The average number of commands per second.
    pub per_second: f64,
    /// The number of commands at once, after a while without any.
    pub burst: u32,
}

/// The bucket of a cell.
#[derive(Debug)]
pub struct Bucket {
    tokens: f64,
    /// The time at which the bucket had this many tokens, in milliseconds.
    at: u64,
}

impl Bucket {
    /// Returns a full bucket.
    pub fn full(rate: Rate, now: u64) -> Self {
        Self { tokens: rate.burst.into(), at: now }
    }

    /// Returns the number of tokens now.
    pub fn left(&self, rate: Rate, now: u64) -> f64 {
        // A clock that is set back adds no tokens.
        let seconds = core::time::Duration::from_millis(now.saturating_sub(self.at)).as_secs_f64();
        (self.tokens + seconds * rate.per_second).min(rate.burst.into())
    }

    /// Takes a token; returns false if there is less than one.
    pub fn take(&mut self, rate: Rate, now: u64) -> bool {
        (self.tokens, self.at) = (self.left(rate, now), now);
        let is_there = self.tokens >= 1.0;
        if is_there {
            self.tokens -= 1.0;
        }
        is_there
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_burst_and_then_the_rate() {
        let rate = Rate { per_second: 2.0, burst: 3 };
        let mut bucket = Bucket::full(rate, 1000);
        let taken = |bucket: &mut Bucket, now| (0..9).filter(|_| bucket.take(rate, now)).count();
        assert_eq!(taken(&mut bucket, 1000), 3);
        assert_eq!(taken(&mut bucket, 1499), 0);
        assert_eq!(taken(&mut bucket, 1500), 1);
        assert_eq!(taken(&mut bucket, 900), 0);
        assert_eq!(taken(&mut bucket, 1000), 0);
        assert_eq!(taken(&mut bucket, 99_000), 3);
    }
}
