//! The time by which an answer must leave.

use core::time::Duration;

use super::config::HostConfig;
use crate::timing::{after, transmission_nanos, window_after_nanos, window_nanos};

/// The time by which an answer must leave.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ReplyDeadline {
    /// The shortest answer must have begun.
    pub begin_by: Duration,
    /// The answer must have ended.
    pub end_by: Duration,
}

impl ReplyDeadline {
    /// Returns the answer to a start message that arrived at `now`.
    pub(super) fn start(now: Duration, config: &HostConfig) -> Self {
        let window = window_nanos(config.mode.accumulation());
        Self::new(now, window, config.reply_len(0).saturating_sub(1), config)
    }

    /// Returns the reply, with at least this many values, to a standard message of `len` bytes that arrived at `now`.
    pub(super) fn reply(now: Duration, len: usize, values: u32, config: &HostConfig) -> Self {
        let window = window_after_nanos(config.mode.accumulation(), config.baud, len);
        Self::new(now, window, config.reply_len(values as usize), config)
    }

    /// Returns the deadlines. `begin_by` is always later than `now`: an answer that may be too late is tried once.
    fn new(now: Duration, window: u64, shortest: usize, config: &HostConfig) -> Self {
        let slack = window.saturating_sub(transmission_nanos(shortest, config.baud)).max(1);
        Self { begin_by: after(now, slack), end_by: after(now, window) }
    }

    /// Returns whether an answer of `len` bytes that is sent at `now` ends in time, with `reserve` left.
    pub(super) fn fits(&self, now: Duration, len: usize, reserve: Duration, config: &HostConfig) -> bool {
        let takes = u128::from(transmission_nanos(len, config.baud)) + reserve.as_nanos();
        now.as_nanos() + takes <= self.end_by.as_nanos()
    }
}
