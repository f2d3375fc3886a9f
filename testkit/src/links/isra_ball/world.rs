//! What is in the model's world, and what can happen in it.

use core::time::Duration;

use isra_ball::ball::machine::BallMachine;
use isra_ball::host::machine::HostMachine;
use isra_ball::{BallConfig, HostConfig};
use robot_session::end::Rules;

/// The time of a tick.
pub const TICK: Duration = Duration::from_millis(5);
/// The ticks of a poll and its packet on the line.
pub(super) const LINE: u8 = 2;

/// A system: bounds and faults.
#[derive(Debug, Clone, Copy)]
pub struct Exchange {
    /// The host's configuration.
    pub config: Config,
    /// The ball's configuration.
    pub ball: BallConfig,
    /// How many faults at most.
    pub faults: u8,
    /// The most ticks that a packet is late.
    pub delay: u8,
    /// Every packet is late by this many more, which is more than the host assumes.
    pub lag: u8,
    /// The ball may have no new values at any time.
    pub idle: bool,
    /// Noise may be a poll to the ball: a fault.
    pub noise: bool,
    /// The host may not be called for a while: a fault.
    pub sleeps: bool,
}

/// The host's configuration on a line of whole ticks.
#[derive(Debug, Clone, Copy)]
pub struct Config(pub HostConfig);

impl Config {
    const WHOLE: Self = Self(HostConfig {
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

    /// Three ticks late is in time, later than the next poll is due.
    pub(super) fn patient(self) -> Self {
        let (max_delay, max_age) = (Duration::from_micros(17_500), Duration::from_millis(85));
        Self(HostConfig { max_delay, max_age, ..self.0 })
    }

    /// No tick late is in time, and replies come until the next poll is due: those that are late by whole periods would fit.
    pub(super) fn punctual(self) -> Self {
        Self(HostConfig { max_delay: Duration::from_micros(4900), ..self.0 })
    }

    /// The greatest age in ticks.
    pub(super) fn max_age(&self) -> u8 {
        (self.0.max_age.as_nanos() / TICK.as_nanos()) as u8
    }
}

impl Exchange {
    /// A ball that has new values at every tick.
    pub fn steady() -> Self {
        let (config, ball) = (Config::WHOLE, BallConfig::default());
        Self { config, ball, faults: 1, delay: 1, lag: 0, idle: false, noise: false, sleeps: true }
    }

    /// A ball that measures when it likes.
    pub fn slow() -> Self {
        Self { idle: true, ..Self::steady() }
    }

    /// A ball that has new values at every tick, all of whose packets are this many ticks late.
    pub fn late(lag: u8) -> Self {
        let steady = Self::steady();
        Self { config: steady.config.punctual(), delay: 0, lag, faults: 0, ..steady }
    }

    /// No packet is in time.
    pub(super) fn is_late(&self) -> bool {
        self.lag > 0
    }

    /// From this age on values are just as old.
    pub(super) fn oldest(&self) -> u8 {
        self.config.max_age() + self.delay + LINE + 2
    }
}

/// A packet between the ball and the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Packet {
    /// Ticks until it arrives; 0 in the host's input.
    pub ticks: u8,
    pub(super) fresh: bool,
    pub(super) age: u8,
    pub(super) measured: bool,
    /// It answers the poll that is open.
    pub(super) reply: bool,
}

/// The state of everything.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct State {
    /// The host's machine.
    pub host: HostMachine,
    /// The ball's machine.
    pub ball: BallMachine,
    /// The age of the ball's values in ticks; they were measured, or never.
    pub(super) age: u8,
    pub(super) measured: bool,
    /// An ENQ has come on this connection of the ball and was not answered.
    pub(super) asked: bool,
    /// How long the ball has had the poll that it is to answer.
    pub(super) waits: u8,
    /// On the line and in the host's input, oldest first.
    pub up: Vec<Packet>,
    pub(super) asleep: bool,
    pub(super) open: bool,
    /// The age of the values in use, and whether they were measured.
    pub(super) using: Option<(u8, bool)>,
    /// The host has reported a packet that is no reply.
    pub(super) said: bool,
    /// For how many ticks values have been used that are too old, though every packet is late and something else has happened.
    pub(super) too_old: u8,
    pub(super) faults: u8,
    pub(super) wrong: Option<&'static str>,
}

impl State {
    /// The host is not called.
    pub fn is_asleep(&self) -> bool {
        self.asleep
    }

    /// A poll has no outcome yet.
    pub fn is_open(&self) -> bool {
        self.open
    }

    /// Values are in use.
    pub fn is_using(&self) -> bool {
        self.using.is_some()
    }
}

/// What happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Act {
    /// The host does what came due.
    Timer,
    /// The host sends ENQ.
    Poll {
        /// It arrives.
        arrives: bool,
    },
    /// The ball sends its packet.
    Reply(Fate),
    /// The host reads the oldest packet.
    Receive,
    /// Time passes.
    Tick {
        /// The sensor has new values.
        measures: bool,
    },
    /// The sensor has new values within a tick.
    Measure,
    /// The ball receives an ENQ that nobody has sent.
    Noise,
    /// The host is not called any more.
    Sleep,
    /// The host is called again.
    Wake,
    /// A new host on the same line.
    RestartHost,
    /// The host's port is lost and opened again.
    ReopenHost,
    /// The ball is switched off and on.
    RestartBall,
    /// The ball's end of the line is lost and there again.
    ReopenBall,
    /// The line is plugged into another ball, which has values of long ago; the host's port is opened again.
    OtherBall,
}

/// What becomes of a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// It arrives, this many ticks late.
    Late(u8),
    /// Nothing of it arrives.
    Lost,
    /// It arrives with a wrong checksum.
    Corrupt,
}

impl Act {
    pub(super) fn is_fault(self) -> bool {
        match self {
            Self::Poll { arrives } => !arrives,
            Self::Reply(fate) => !matches!(fate, Fate::Late(_)),
            Self::Timer | Self::Receive | Self::Tick { .. } | Self::Measure | Self::Wake => false,
            Self::Noise
            | Self::Sleep
            | Self::RestartHost
            | Self::ReopenHost
            | Self::RestartBall
            | Self::ReopenBall
            | Self::OtherBall => true,
        }
    }
}
