use core::time::Duration;

use crate::error::ConfigError;
use crate::timing;

/// Settings of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HostConfig {
    /// The line's rate in baud, above 0. Default: 9600, as in the source (§4.1). A packet that comes sooner after a poll than the
    /// line can carry both is not a reply to it; a tolerance of a tenth allows for inexact clocks.
    pub baud: u32,
    /// The shortest time between polls; not below [`timing::min_period`]. Default: 28 ms, the robot's cycle (§3.4), which the
    /// ball's 13.54 ms fit into.
    pub period: Duration,
    /// An assumption: the longest delay of a packet by ball, line and driver, without its transmission time. Default: 14 ms,
    /// which with the packet fits the period.
    ///
    /// A poll without a packet for this long is missed, and the next one is later than a period after it, because packets have no
    /// number: were all of them late by whole periods, each would seem to be the reply to another poll. So they are
    /// [`HostEvent::Unasked`](crate::HostEvent::Unasked) now and then, and no values are new.
    pub max_delay: Duration,
    /// The age at which values are [`HostEvent::Stale`](crate::HostEvent::Stale). Above two
    /// periods and a reply window. Default: 150 ms, which outlasts one lost packet, or two old ones in succession, by 21 ms
    /// if every reply is as late as it may be; the source gives none. [`Duration::MAX`] means no limit.
    pub max_age: Duration,
    /// Whether the line returns the sent bytes, as adapters for two wires do. Off. Each poll comes back
    /// first then, and is dropped; another byte is [`HostEvent::Echo`](crate::HostEvent::Echo), a collision. While it is
    /// off, polls that come back are corrupt bytes.
    pub echo: bool,
    /// The rules of the machine, all of which are kept.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub rules: robot_session::end::Rules<Rule>,
}

robot_session::rules! {
    /// The rules of the host's machine against the use of old values.
    pub enum Rule for HostConfig {
        /// After a connection is made, nothing is sent until the reply to a poll of before would have come, and longer than
        /// from one poll to the next.
        DrainFirst,
        /// The next poll is sent only when the reply to the last one has come or can come no more.
        AwaitReply,
        /// After a poll without a reply the next one is later than after one with a reply: packets that are late by whole periods
        /// do not fit both.
        Uneven,
        /// A packet that comes faster than the line rate is not a reply.
        NotBefore,
        /// New values are newer than the previous reply: without a recent reply nothing is known of their age.
        ProveAge,
        /// The age of values counts from the poll that the reply before them answered.
        AgeFromPoll,
        /// Values that the ball marks as old are not new.
        OldIsNotNew,
        /// The poll and the values that a connection's end ends are reported.
        ReportEnd,
        /// A reply on one connection proves nothing on the next: another ball may be there.
        ForgetReply,
    }
}

impl HostConfig {
    /// Returns the time from a poll until its reply can no longer come.
    pub fn reply_window(&self) -> Duration {
        timing::exchange_time(self.baud).saturating_add(self.max_delay)
    }

    /// Returns the time from a connection to the first poll, and from a poll without a reply to the next one: 44.71 ms with
    /// the defaults. Other polls follow one another sooner, by more than the delays of replies may differ, so that no delay
    /// fits both.
    pub fn quiet(&self) -> Duration {
        self.period.max(self.reply_window()).saturating_add(self.spread())
    }

    /// Returns a time that is longer than the difference between the delays of two valid replies, by the tolerance for clocks.
    pub(crate) fn spread(&self) -> Duration {
        self.max_delay.saturating_add(timing::exchange_time(self.baud) / 5)
    }

    /// Returns the time from a poll until its reply can come.
    pub(crate) fn earliest_reply(&self) -> Duration {
        let exact = timing::exchange_time(self.baud);
        exact.saturating_sub(exact / 10)
    }

    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        let minimum = timing::min_period(self.baud);
        if self.period < minimum {
            return Err(ConfigError::Period { minimum, found: self.period });
        }
        // Values count from the poll before theirs, and hold until the next reply, at the end of its window.
        let window = self.reply_window();
        let minimum = window.max(self.period).saturating_mul(2).saturating_add(window);
        if self.max_age <= minimum && self.max_age < Duration::MAX {
            return Err(ConfigError::MaxAge { minimum, found: self.max_age });
        }
        Ok(())
    }
}

impl Default for HostConfig {
    fn default() -> Self {
        Self {
            baud: timing::BAUD,
            period: Duration::from_millis(28),
            max_delay: Duration::from_millis(14),
            max_age: Duration::from_millis(150),
            echo: false,
            #[cfg(feature = "model")]
            rules: robot_session::end::Rules::ALL,
        }
    }
}
