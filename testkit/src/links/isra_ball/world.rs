//! The line of the models, and its properties.

use core::time::Duration;

use isra_ball::HostConfig;
use robot_session::end::Rules;

/// The time of a tick: at 13,000 baud poll and packet take two.
pub const TICK: Duration = Duration::from_millis(5);
/// The ticks of a poll and its packet on the line.
pub(super) const LINE: u8 = 2;

pub(super) const AGE: &str = "values are used no longer than max_age";
pub(super) const FOUND_OUT: &str =
    "with another fault values that are too old are used no longer than max_age";
pub(super) const STALE: &str = "who uses values learns when they are stale";
pub(super) const ONE_OUTCOME: &str = "a poll has one outcome";
pub(super) const PAIRED: &str = "a packet is the reply to the poll that it ends";
pub(super) const ASKED: &str = "the ball sends nothing unasked";
pub(super) const CLAIMED: &str = "without a fault nothing is missed, stale or unasked";

/// The host's configuration on a line of whole ticks.
#[derive(Debug, Clone, Copy)]
pub struct Config(pub HostConfig);

impl Config {
    pub(super) const WHOLE: Self = Self(HostConfig {
        baud: 13_000,
        period: Duration::from_millis(15),
        // A packet that is one tick late is in time.
        max_delay: Duration::from_micros(7500),
        max_age: Duration::from_millis(55),
        echo: false,
        rules: Rules::ALL,
    });

    pub(super) fn without(self, rule: isra_ball::host::Rule) -> Self {
        Self(HostConfig { rules: Rules::without(rule), ..self.0 })
    }

    /// Returns the setup in which a packet three ticks late is in time, after the next poll is due.
    pub(super) fn patient(self) -> Self {
        let (max_delay, max_age) = (Duration::from_micros(17_500), Duration::from_millis(85));
        Self(HostConfig { max_delay, max_age, ..self.0 })
    }

    /// Returns the setup in which a late packet is never in time, and replies come until the next poll is due: replies that
    /// are late by whole periods would fit.
    pub(super) fn punctual(self) -> Self {
        Self(HostConfig { max_delay: Duration::from_micros(4900), ..self.0 })
    }

    /// Returns the greatest age in ticks.
    pub(super) fn max_age(&self) -> u8 {
        (self.0.max_age.as_nanos() / TICK.as_nanos()) as u8
    }
}
