//! When an answer must leave.

use core::time::Duration;

use super::config::HostConfig;
use crate::framing::Framing;
use crate::message::AXES;
use crate::timing::{max_reply_len, transmission, transmission_nanos, window};

/// The longest reply in any framing.
pub(super) const LONGEST: usize = max_reply_len(AXES, Framing { stuffed_checksum: true, ..Framing::DEFAULT });

/// When an answer must leave.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Due {
    /// The shortest answer must have begun.
    pub begin_by: Duration,
    /// The answer must have ended.
    pub end_by: Duration,
}

impl Due {
    /// The answer to a start message that arrived at `now`.
    pub(super) fn start(now: Duration, config: &HostConfig) -> Self {
        Self::new(now, window(config.mode.accumulation()), config.reply_len(0).saturating_sub(1), config)
    }

    /// The reply, of so many values at least, to a standard message of `len` bytes that arrived at `now`.
    pub(super) fn reply(now: Duration, len: usize, values: u32, config: &HostConfig) -> Self {
        Self::new(now, config.window(len), config.reply_len(values as usize), config)
    }

    /// What may be too late already may be tried once: a deadline lies ahead.
    fn new(now: Duration, window: Duration, shortest: usize, config: &HostConfig) -> Self {
        let slack = window.saturating_sub(transmission(shortest, config.baud)).max(Duration::from_nanos(1));
        Self { begin_by: now.saturating_add(slack), end_by: now.saturating_add(window) }
    }

    /// Whether any reply that is sent at `now` ends in time: then its length need not be known.
    pub(super) fn fits_any(&self, now: Duration, config: &HostConfig) -> bool {
        self.fits(now, LONGEST, config.reserve, config)
    }

    /// Whether an answer of `len` bytes that is sent at `now` ends in time, with something left.
    pub(super) fn fits(&self, now: Duration, len: usize, reserve: Duration, config: &HostConfig) -> bool {
        let takes = u128::from(transmission_nanos(len, config.baud)) + reserve.as_nanos();
        now.as_nanos() + takes <= self.end_by.as_nanos()
    }
}
