use core::num::NonZeroU16;
use core::time::Duration;

use crate::dialect::Dialect;
use crate::error::ConfigError;
use crate::numbering::{AheadJobs, Numbering};
use crate::packet::Limits;
use crate::robot::state::RecoveryStep;
use crate::role::Role;
use crate::timing;

/// Settings of a robot session. The source gives the limits and the exchange time; the other defaults are this project's.
///
/// Every duration can be [`Duration::MAX`]: never.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RobotConfig {
    /// The table of messages; by default [`Dialect::DEFAULT`].
    pub dialect: Dialect,
    /// The limits of a packet in bytes; by default 4096 in strings of 255, over UDP 1472.
    pub limits: Limits,
    /// Whether every input is a datagram: messages do not continue in the next one, and it may come late. The start of an
    /// order that has ended is refused, and no start is considered for [`LATEST_DATAGRAM`](timing::LATEST_DATAGRAM) after the
    /// first connection. False by default.
    pub datagrams: bool,
    /// The highest job number, 2 to 9999, on which both ends have agreed, and that of the queue. 9999 by default.
    pub max_number: u16,
    /// The way in which executed jobs are acknowledged, as configured at the PC too. Every job by default.
    pub acks: Acks,
    /// After the queue was full, jobs are requested when at most this many remain in it. `None`, the default: half the queue.
    pub low_water: Option<usize>,
    /// The number of times that each step of the recovery is taken; 3 resends, 3 pauses and 1 clear by default.
    pub recovery: RecoveryLimits,
    /// The time for which the next job may be missing, with nothing more to execute, before a recovery step is taken: 1 s by
    /// default, which an order whose jobs take longer to compute must raise. See [`alarm_bound`](Self::alarm_bound).
    pub patience: Duration,
    /// The duration of a recovery pause; 500 ms by default.
    pub pause: Duration,
    /// The time for which a cycle waits for an answer, and for the rest of a partial one, before it starts again; 1 s by
    /// default. On a serial line, set it longer than both packets take: 4096 bytes at 115200 baud take 356 ms.
    pub reply_timeout: Duration,
    /// The shortest time between packets; by default the 32 ms of the source's controller.
    pub exchange: Duration,
    /// The number of cycles without an answer after which the connection is dropped; 0: never. 5 by default.
    pub silent_cycles: u16,
    /// The delay before a lost connection is reopened; 1 s by default.
    pub reconnect_delay: Duration,
    /// The longest time between two status messages; 1 s by default.
    pub status_period: Duration,
    /// Whether to answer 0 to the start of the order that is already active and has jobs: otherwise the source's answer, the
    /// order's own number, looks like acceptance. The start of an order without jobs is accepted again in any case. True by
    /// default.
    pub refuse_repeated_start: bool,
    /// Whether to end the active order when the PC's status names another one or none. The source calls it less safe than
    /// waiting for the PC to end it (thesis, section 11.2). False by default.
    pub end_foreign_order: bool,
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub rules: robot_session::end::Rules<Rule>,
}

robot_session::rules! {
    /// The rules against wrong execution and deadlock; the model shows that each is needed.
    #[doc(hidden)]
    pub enum Rule for RobotConfig {
        /// Messages after a failed one are dropped, including the order's end; corrupt bytes are a failed message.
        DestroyRest,
        /// An end does not count until the missing jobs have come, or must come twice, each time after a request.
        EndFillsGap,
        /// An end that may answer a packet before those requests, because packets were not answered in time, does not count.
        CountUnanswered,
        /// After a new connection jobs are missing, too, and an end has no effect while the list is cleared.
        GapAtConnection,
        /// Recovery steps are taken by the clock, while nothing more is to be executed.
        StepsByClock,
        /// A connection that ends while nothing more is to be executed is a step, too.
        ClosingIsStep,
        /// A cleared queue is checked twice, and the jobs executed until then are reported in between.
        SettledTwice,
        /// Over datagrams, the start of an order that is over is refused.
        NewStarts,
        /// Over datagrams, a robot ignores starts for a while after its own start.
        IgnoreStarts,
        /// Over datagrams, a start that waited to be read while the session was not called is late, too.
        DrainStarts,
    }
}

impl RobotConfig {
    /// Returns the configuration over TCP, as in the source's application.
    pub const fn tcp() -> Self {
        Self {
            dialect: Dialect::DEFAULT,
            limits: Limits::TCP,
            datagrams: false,
            max_number: Dialect::MAX_NUMBER,
            acks: Acks::Cumulative { every: NonZeroU16::MIN },
            low_water: None,
            recovery: RecoveryLimits { resends: 3, pauses: 3, clears: 1 },
            patience: Duration::from_secs(1),
            pause: Duration::from_millis(500),
            reply_timeout: Duration::from_secs(1),
            exchange: timing::EXCHANGE,
            silent_cycles: 5,
            reconnect_delay: Duration::from_secs(1),
            status_period: Duration::from_secs(1),
            refuse_repeated_start: true,
            end_foreign_order: false,
            #[cfg(feature = "model")]
            rules: robot_session::end::Rules::ALL,
        }
    }

    /// Returns the configuration over UDP.
    pub const fn udp() -> Self {
        Self { limits: Limits::UDP, datagrams: true, ..Self::tcp() }
    }

    /// Returns the longest time without progress of an order before the alarm, whatever the PC does while it is connected:
    /// from the time at which nothing more is to be executed. Time in which a connection is being opened does not count, nor
    /// does that in which the motion task does not check its queue. With the defaults 17.5 s at most; 10 s if the PC answers
    /// every packet at once.
    pub fn alarm_bound(&self) -> Duration {
        let RecoveryLimits { resends, pauses, clears } = self.recovery;
        let steps = u32::from(resends) + u32::from(pauses) + u32::from(clears) + 1;
        // The time of a step begins with a packet, which is sent in the next cycle.
        let each = self.reply_timeout.max(self.exchange).saturating_add(self.patience);
        each.saturating_mul(steps).saturating_add(self.pause.saturating_mul(u32::from(pauses)))
    }

    /// Checks the configuration. A job's own fields have at most `work` bytes; a session can hold a message of `held` bytes,
    /// and its queue `capacity` jobs.
    pub(crate) fn check(&self, work: usize, held: usize, capacity: usize) -> Result<(), ConfigError> {
        let individual = self.acks == Acks::Individual;
        self.dialect.check(self.max_number, self.datagrams, [individual.then_some(Role::JobAck), None])?;
        let limit = AheadJobs::MAX as usize;
        if individual && capacity > limit {
            return Err(ConfigError::LongQueue { capacity, limit });
        }
        self.limits.check(&self.dialect, work, held)
    }

    /// Returns the numbers of the jobs.
    pub(crate) const fn numbering(&self) -> Numbering {
        Numbering::new(self.max_number)
    }

    /// Returns the recovery step after this many failures.
    pub(super) fn step(&self, failures: u32) -> RecoveryStep {
        let RecoveryLimits { resends, pauses, clears } = self.recovery;
        let (resends, pauses, clears) = (u32::from(resends), u32::from(pauses), u32::from(clears));
        match failures {
            _ if failures <= resends => RecoveryStep::Resend,
            _ if failures <= resends + pauses => RecoveryStep::Pause,
            _ if failures <= resends + pauses + clears => RecoveryStep::Clear,
            _ => RecoveryStep::Alarm,
        }
    }
}

impl Default for RobotConfig {
    fn default() -> Self {
        Self::tcp()
    }
}

/// The way in which executed jobs are acknowledged (thesis, section 11.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Acks {
    /// Jobs are executed in the order of their numbers, and an acknowledgement covers all before it.
    Cumulative {
        /// The k of "every k-th job is acknowledged", 1 for every job. The rest are acknowledged when there is no other message
        /// to send and no job to execute.
        every: NonZeroU16,
    },
    /// Jobs may overtake one another: each is acknowledged individually. The queue has at most 1024 jobs.
    Individual,
}

/// The number of times that each step of the recovery is taken before the next. The source names the steps; the counts are
/// this project's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RecoveryLimits {
    /// The number of times that jobs are requested again.
    pub resends: u16,
    /// The number of times that the PC is requested to pause.
    pub pauses: u16,
    /// The number of times that the queue is cleared.
    pub clears: u16,
}

impl Default for RecoveryLimits {
    fn default() -> Self {
        Self { resends: 3, pauses: 3, clears: 1 }
    }
}
