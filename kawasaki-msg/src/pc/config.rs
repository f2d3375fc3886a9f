use core::time::Duration;

use crate::dialect::Dialect;
use crate::error::ConfigError;
use crate::numbering::{AheadJobs, Numbering};
use crate::packet::Limits;
use crate::role::Role;
use crate::timing;

/// Settings of a PC session. The source gives the limits and the reply delay; the other defaults are this project's.
///
/// Every duration can be [`Duration::MAX`]: never.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PcConfig {
    /// The table of messages; by default [`Dialect::DEFAULT`].
    pub dialect: Dialect,
    /// The limits of a packet in bytes; by default 4096 in strings of 255, over UDP 1472.
    pub limits: Limits,
    /// Whether every input is a datagram: messages do not continue in the next one, and it may come late. False by default.
    pub datagrams: bool,
    /// The highest job number, 2 to 9999, on which both ends have agreed; above the capacity of the robot's queue. 9999 by
    /// default. At most one job fewer is in flight, over datagrams half as many, and 1024 if jobs may overtake one another.
    /// If it covers the whole order, a mistake at the wrap is impossible (thesis, section 11.1.1).
    pub max_number: u16,
    /// Whether an acknowledgement covers all earlier jobs; false if jobs may overtake one another. True by default.
    pub cumulative_acks: bool,
    /// The time between the last byte from the robot and the answer; 2 ms by default.
    pub reply_delay: Duration,
    /// The timeout without a message, or without an answer to a start, after which the connection is dropped; 10 s by default.
    pub silence: Duration,
    /// The reaction when the robot refuses a start because another order is active; by default that order is interrupted.
    pub takeover: Takeover,
    /// The number of retries of a start that the robot refuses without an active order; 10 by default.
    pub start_retries: u16,
    /// Whether to end the order when all its jobs are executed. True by default.
    pub end_when_done: bool,
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub rules: robot_session::end::Rules<Rule>,
}

robot_session::rules! {
    /// The rules against false reports of a PC; the model shows that each is needed.
    #[doc(hidden)]
    pub enum Rule for PcConfig {
        /// No start before the robot's status on this connection; an order with the PC's number whose start this session has
        /// not sent is another's, even if it has no jobs: some may be executed ahead.
        LearnIdentity,
        /// An interruption waits for the answer to the start: an end of our number before that belongs to the previous order.
        CancelWaits,
        /// A start is sent once on a connection; a start that is not answered in time ends the connection, and with it
        /// everything in flight.
        StartOnce,
        /// With individual acknowledgements, an end after corrupt or lost bytes leaves other jobs unknown.
        DoubtCorrupt,
        /// One number is never in flight twice.
        Window,
        /// Over datagrams, a report of another order may be late.
        LateReports,
    }
}

impl PcConfig {
    /// Returns the configuration over TCP, as in the source's application.
    pub const fn tcp() -> Self {
        Self {
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
            #[cfg(feature = "model")]
            rules: robot_session::end::Rules::ALL,
        }
    }

    /// Returns the configuration over UDP.
    pub const fn udp() -> Self {
        Self { limits: Limits::UDP, datagrams: true, ..Self::tcp() }
    }

    /// Checks the configuration. A job's own fields have at most `work` bytes; a session can hold a message of `held` bytes.
    pub(crate) fn check(&self, work: usize, held: usize) -> Result<(), ConfigError> {
        let job_ack = (!self.cumulative_acks).then_some(Role::JobAck);
        let interrupt = (self.takeover == Takeover::Interrupt).then_some(Role::OrderInterrupt);
        self.dialect.check(self.max_number, self.datagrams, [job_ack, interrupt])?;
        self.limits.check(&self.dialect, work, held)
    }

    /// Returns the numbers of the jobs.
    pub(crate) const fn numbering(&self) -> Numbering {
        Numbering::new(self.max_number)
    }

    /// Returns the maximum number of jobs in flight: with all numbers in use one job could be executed twice. Half the
    /// numbers are reserved over UDP, where a late datagram may bring an old number back.
    pub(super) fn window(&self) -> u32 {
        let max = u32::from(self.max_number);
        let window = match self.datagrams {
            _ if !self.keeps(Rule::Window) => max,
            true => max / 2,
            false => max - 1,
        };
        if self.cumulative_acks { window } else { window.min(AheadJobs::MAX) }
    }
}

impl Default for PcConfig {
    fn default() -> Self {
        Self::tcp()
    }
}

/// How the robot's active order is ended before a new one begins (thesis, section 11.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Takeover {
    /// Not at all: the start is given up.
    Never,
    /// After the queued jobs of that order.
    End,
    /// After the job that is being executed.
    Interrupt,
}
