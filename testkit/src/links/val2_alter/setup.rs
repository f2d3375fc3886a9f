//! What is explored: bounds, faults, and how both ends are configured.

use core::time::Duration;

use robot_session::end::Rules;
use val2_alter::controller::Rule;
use val2_alter::{Accumulation, ControllerConfig, HostConfig, Limits, Mode};

/// A quarter of a cycle.
pub const TICK: Duration = Duration::from_millis(7);

/// What the caller's target is good for, in ticks.
pub(super) const FRESH: u8 = 2;

/// The bounds, and how both ends are configured.
#[derive(Debug, Clone, Copy)]
pub struct Alter {
    /// Faults of any kind.
    pub faults: u8,
    /// Exceptions that the caller has.
    pub jobs: u8,
    /// The host.
    pub host: HostConfig,
    /// The controller.
    pub controller: ControllerConfig,
    /// By how many ticks what is late is late.
    pub late: u8,
    /// A message and its reply are not both late: together they would be later than the host assumes.
    pub late_once: bool,
    /// The controller's program names another mode.
    pub other_mode: bool,
    /// The controller keeps the words that come in an interruption.
    pub takes_all: bool,
    /// The controller also interrupts ALTER by itself.
    pub interrupts: bool,
    /// An operator ends a program whose host does not answer.
    pub operator: bool,
    /// Corrupt messages are counted where no ALTER is on.
    pub repeats: bool,
}

impl Alter {
    /// No faults.
    pub fn new(mode: Mode) -> Self {
        let baud = 19_200;
        let host = HostConfig {
            mode,
            baud,
            subroutine: true,
            // One word fits, another one only when it is in use already.
            reserve: Duration::from_millis(if mode.accumulation() == Accumulation::NonCumulative {
                10
            } else {
                8
            }),
            limits: Limits::NONE,
            target_timeout: TICK * u32::from(FRESH),
            silence_cycles: 3,
            gap: None,
            ..HostConfig::default()
        };
        let controller =
            ControllerConfig { mode, baud, subroutine: true, gap: None, ..ControllerConfig::default() };
        Self {
            faults: 0,
            jobs: 0,
            host,
            controller,
            late: 1,
            late_once: false,
            other_mode: false,
            takes_all: true,
            interrupts: false,
            operator: false,
            repeats: false,
        }
    }

    /// A controller that goes on after a timeout, and takes a reply that comes too late all the same, on a line that keeps what
    /// the host assumes of it.
    pub fn goes_on(mut self) -> Self {
        self.controller.rules = Rules::without_both(Rule::EndOnMissing, Rule::FirstReply);
        (self.operator, self.late_once) = (true, true);
        self
    }

    /// A host that asks once for a corrupt start message.
    pub fn repeats_once(mut self) -> Self {
        (self.host.repeats, self.repeats) = (1, true);
        self
    }

    /// What is late is late by a cycle, and the host knows.
    pub fn late_lines(mut self) -> Self {
        (self.host.max_delay, self.late) = (TICK * 4, 4);
        self
    }

    pub(super) fn is_offset(&self) -> bool {
        self.host.mode.accumulation() == Accumulation::NonCumulative
    }

    /// Whether the line keeps what the host assumes of it by default.
    pub(super) fn is_in_time(&self) -> bool {
        self.late <= 1
    }

    /// After how many ticks without a message the controller counts as lost.
    pub(super) fn silence(&self) -> u8 {
        4 * self.host.silence_cycles as u8
    }
}
