//! Cycle times: the last one, and the mean of the last 20 (thesis, section 12).

use core::time::Duration;

/// The last times of one kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Times {
    rounds: [Duration; Self::ROUNDS],
    count: u64,
}

impl Times {
    /// Over how many rounds the mean goes.
    pub const ROUNDS: usize = 20;

    /// Takes in one more round.
    pub fn record(&mut self, time: Duration) {
        let place = usize::try_from(self.count % Self::ROUNDS as u64).unwrap_or(0);
        if let Some(round) = self.rounds.get_mut(place) {
            *round = time;
        }
        self.count += 1;
    }

    /// The last round; `None` before the first.
    pub fn last(&self) -> Option<Duration> {
        let before = self.count.checked_sub(1)? % Self::ROUNDS as u64;
        self.rounds.get(usize::try_from(before).ok()?).copied()
    }

    /// The mean of the last 20 rounds, or of as many as there were.
    pub fn mean(&self) -> Option<Duration> {
        let rounds = u32::try_from(self.count.min(Self::ROUNDS as u64)).ok()?;
        let sum: Duration = self.rounds.iter().take(usize::try_from(rounds).ok()?).sum();
        sum.checked_div(rounds)
    }

    /// How many rounds there were.
    pub fn count(&self) -> u64 {
        self.count
    }
}

/// What a robot session has measured and counted since it was made.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Statistics {
    /// From sending a packet to having received its answer.
    pub exchange: Times,
    /// Unpacking a packet and queueing its jobs, as the caller measured it.
    pub unpack: Times,
    /// From one job done to the next.
    pub work_cycle: Times,
    /// Packets sent.
    pub packets: u64,
    /// Jobs queued.
    pub queued: u64,
    /// Jobs executed.
    pub executed: u64,
    /// Jobs that came again and were dropped.
    pub repeated: u64,
    /// Jobs refused or discarded: asked for again.
    pub discarded: u64,
    /// Cycles without an answer.
    pub unanswered: u64,
    /// Events that found no place because nobody polled them.
    pub missed_events: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_goes_over_the_last_twenty() {
        let mut times = Times::default();
        assert_eq!((times.last(), times.mean()), (None, None));
        times.record(Duration::from_millis(100));
        assert_eq!(times.mean(), Some(Duration::from_millis(100)));
        for _ in 0..19 {
            times.record(Duration::from_millis(20));
        }
        assert_eq!(times.mean(), Some(Duration::from_millis(24)));
        times.record(Duration::from_millis(20));
        assert_eq!(times.mean(), Some(Duration::from_millis(20)));
        assert_eq!((times.last(), times.count()), (Some(Duration::from_millis(20)), 21));
    }
}
