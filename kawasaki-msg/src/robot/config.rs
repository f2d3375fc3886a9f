use core::num::NonZeroU16;
use core::time::Duration;

use crate::dialect::Dialect;
use crate::error::ConfigError;
use crate::job::Bounds;
use crate::packet::Limits;
use crate::robot::recovery::Ladder;
use crate::timing;

/// What a robot session needs to be told. The source gives the limits and the exchange time; the other times and counts are
/// ours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RobotConfig {
    /// The table of messages.
    pub dialect: Dialect,
    /// The limits of a packet.
    pub limits: Limits,
    /// Every input is a datagram: no message goes on in the next one, and it may come late. The start of an order that has ended
    /// is refused, and none is heard for [`LATEST_DATAGRAM`](timing::LATEST_DATAGRAM) after the first connection.
    pub datagrams: bool,
    /// The coordinates that the robot can reach.
    pub bounds: Bounds,
    /// How executed jobs are acknowledged; the PC has to know.
    pub acks: Acks,
    /// After the queue was full, jobs are asked for when at most this many are left in it; half the queue by default.
    pub low_water: Option<usize>,
    /// How often each rung of the recovery is tried.
    pub ladder: Ladder,
    /// How long the recovery pauses.
    pub pause: Duration,
    /// How long a cycle waits for an answer before it starts again.
    pub reply_timeout: Duration,
    /// The least time from one packet to the next: the 32 ms of the source's controller.
    pub exchange: Duration,
    /// After so many cycles without an answer the connection is given up; 0: never.
    pub silent_cycles: u16,
    /// How long to wait before a lost connection is opened again.
    pub reconnect_delay: Duration,
    /// How often at least the status is sent.
    pub status_period: Duration,
    /// Answer 0 to the start of the order that is active already and has jobs: without it the source's answer, the order's own
    /// number, looks like acceptance. The start of an order without jobs is accepted again in any case.
    pub refuse_repeated_start: bool,
    /// End the active order when the PC's status names another one or none. The source calls it less safe than waiting for the
    /// PC to end it (thesis, section 11.2).
    pub end_foreign_order: bool,
}

impl RobotConfig {
    /// Over TCP, as the source's application.
    pub const TCP: Self = Self {
        dialect: Dialect::DEFAULT,
        limits: Limits::TCP,
        datagrams: false,
        bounds: Bounds::WIDEST,
        acks: Acks::Cumulative { every: NonZeroU16::MIN },
        low_water: None,
        ladder: Ladder { resends: 3, pauses: 3, clears: 1 },
        pause: Duration::from_millis(500),
        reply_timeout: Duration::from_secs(1),
        exchange: timing::EXCHANGE,
        silent_cycles: 5,
        reconnect_delay: Duration::from_secs(1),
        status_period: Duration::from_secs(1),
        refuse_repeated_start: false,
        end_foreign_order: false,
    };

    /// Over UDP.
    pub const UDP: Self = Self { limits: Limits::UDP, datagrams: true, ..Self::TCP };

    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        let Bounds { min, max } = self.bounds;
        if min.x > max.x || min.y > max.y {
            return Err(ConfigError::Bounds);
        }
        self.limits.check(&self.dialect)
    }
}

impl Default for RobotConfig {
    fn default() -> Self {
        Self::TCP
    }
}

/// How executed jobs are acknowledged (thesis, section 11.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Acks {
    /// Jobs are executed in the order of their numbers, and an acknowledgement covers all before it: every job, or every k-th,
    /// and what is left when there is nothing else to send.
    #[allow(missing_docs, reason = "the sentence says it")]
    Cumulative { every: NonZeroU16 },
    /// Jobs may overtake one another: each is acknowledged by itself.
    Individual,
}
