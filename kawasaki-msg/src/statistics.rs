//! Cycle times: the last one, and the mean of the last 20 (thesis, section 12).

use core::time::Duration;

/// The last times of one kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Times {
    rounds: [Duration; Self::ROUNDS],
    count: u64,
    /// The time at which the current round began.
    since: Option<Duration>,
}

impl Times {
    /// The number of rounds in the mean.
    pub const ROUNDS: usize = 20;

    /// Records one more round.
    pub fn record(&mut self, time: Duration) {
        let place = usize::try_from(self.count % Self::ROUNDS as u64).unwrap_or(0);
        if let Some(round) = self.rounds.get_mut(place) {
            *round = time;
        }
        self.count += 1;
    }

    /// Begins a round.
    pub(crate) fn begin(&mut self, now: Duration) {
        self.since = Some(now);
    }

    /// Ends the current round, and records it.
    pub(crate) fn end(&mut self, now: Duration) {
        if let Some(since) = self.since.take() {
            self.record(now.saturating_sub(since));
        }
    }

    /// Discards the current round.
    pub(crate) fn cancel(&mut self) {
        self.since = None;
    }

    /// Returns the last round; `None` before the first round.
    pub fn last(&self) -> Option<Duration> {
        let before = self.count.checked_sub(1)? % Self::ROUNDS as u64;
        self.rounds.get(usize::try_from(before).ok()?).copied()
    }

    /// Returns the mean of the last 20 rounds, or of as many as were measured.
    pub fn mean(&self) -> Option<Duration> {
        let rounds = u32::try_from(self.count.min(Self::ROUNDS as u64)).ok()?;
        let last = self.rounds.iter().take(usize::try_from(rounds).ok()?);
        let sum = last.fold(Duration::ZERO, |sum, round| sum.saturating_add(*round));
        sum.checked_div(rounds)
    }

    /// Returns the number of rounds.
    pub fn count(&self) -> u64 {
        self.count
    }
}

robot_session::counters! {
    /// The measurements and counters of a robot session since it was made.
    pub struct RobotStatistics {
        /// The time from sending a packet to having received its answer.
        pub exchange: Times,
        /// The time to unpack a packet and to queue its jobs, as the caller measured it.
        pub unpack: Times,
        /// The time from one job executed to the next one of the same order.
        pub work_cycle: Times,
        /// The number of packets sent.
        pub packets: u64,
        /// The number of jobs queued, of all orders.
        pub queued: u64,
        /// The number of jobs executed, of all orders.
        pub executed: u64,
        /// The number of jobs that came again and were dropped.
        pub repeated: u64,
        /// The number of messages that were destroyed because one before them in the packet failed, or was refused: jobs are
        /// requested again.
        pub discarded: u64,
        /// The number of runs of corrupt bytes.
        pub corrupt: u64,
        /// The number of cycles without an answer.
        pub unanswered: u64,
    }
}

robot_session::counters! {
    /// The counters of a PC session since it was made.
    pub struct PcStatistics {
        /// The number of packets sent.
        pub packets: u64,
        /// The number of runs of corrupt bytes.
        pub corrupt: u64,
    }
}
