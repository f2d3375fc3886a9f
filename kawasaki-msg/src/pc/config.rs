use core::time::Duration;

use crate::dialect::Dialect;
use crate::error::ConfigError;
use crate::packet::Limits;
use crate::timing;

/// What a PC session needs to be told. The source gives the limits and the reply delay; the rest is ours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PcConfig {
    /// The table of messages.
    pub dialect: Dialect,
    /// The limits of a packet.
    pub limits: Limits,
    /// Every input is a datagram: no message goes on in the next one.
    pub datagrams: bool,
    /// The highest job number, which both ends have agreed on; above the capacity of the robot's queue. Where it covers the whole
    /// order, a mistake at the wrap is impossible (thesis, section 11.1.1).
    pub max_number: u16,
    /// Whether an acknowledgement covers all jobs before it: not where jobs may overtake one another.
    pub cumulative_acks: bool,
    /// How long after the last byte from the robot the answer goes out.
    pub reply_delay: Duration,
    /// After so long without a message the connection is given up; zero: never.
    pub silence: Duration,
    /// What to do when the robot refuses a start because another order is active.
    pub takeover: Takeover,
    /// How often a start that the robot refuses without an active order is tried again.
    pub start_retries: u16,
    /// End the order when all its jobs are executed.
    pub end_when_done: bool,
}

impl PcConfig {
    /// Over TCP, as the source's application.
    pub const TCP: Self = Self {
        dialect: Dialect::DEFAULT,
        limits: Limits::TCP,
        datagrams: false,
        max_number: Dialect::MAX_NUMBER,
        cumulative_acks: true,
        reply_delay: timing::MIN_REPLY_DELAY,
        silence: Duration::from_secs(10),
        takeover: Takeover::Interrupt,
        start_retries: 10,
        end_when_done: true,
    };

    /// Over UDP.
    pub const UDP: Self = Self { limits: Limits::UDP, datagrams: true, ..Self::TCP };

    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        if !(2..=Dialect::MAX_NUMBER).contains(&self.max_number) {
            return Err(ConfigError::MaxNumber { found: self.max_number });
        }
        self.limits.check(&self.dialect)
    }
}

impl Default for PcConfig {
    fn default() -> Self {
        Self::TCP
    }
}

/// How an order that the robot is still in is brought to an end before ours begins (thesis, section 11.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Takeover {
    /// Not at all: the start is given up.
    Never,
    /// Its queued jobs are executed first.
    End,
    /// After the job that is being executed.
    Interrupt,
}
