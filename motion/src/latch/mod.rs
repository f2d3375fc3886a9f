//! The operator's latch: whether the hand may move the arm. Pure: no clock, no line, no input device.
//!
//! ```text
//!            ALTER runs        the hand rests       rested for `rest`      (confirmed)
//!  Off ───────────────▶ Disarmed ────────▶ Resting ───────────────▶ Ready ────────▶ Armed
//!   ▲                      ▲  a push, or old values │                 │ old values    │ old values, lost input,
//!   │ ALTER ends           └────────────────────────┴─────────────────┴───────────────┘ another profile
//!   │
//!  Stopping, Ending ◀── stop, end: from every state; the values go to zero, and nothing arms
//! ```
//!
//! Every start of ALTER, every interruption, an arm that the robot stops, old values, a lost input, a stop and a changed
//! profile disarm. Only fresh values of a hand at rest arm, uninterrupted for [`LatchConfig::rest`]: an arm never moves
//! merely because a lost input or connection has returned. Single values may be missing in between, as long as those before
//! them are fresh.
//!
//! As the model has explored it:
#![doc = include_str!("../../diagrams/latch.md")]

mod config;

use core::time::Duration;

use robot_session::Unexpected;
use robot_session::end::{Expiry, Machine, is_due};

pub use config::LatchConfig;
#[doc(hidden)]
pub use config::Rule;

/// The latch. Every time is a deadline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Latch {
    /// No ALTER runs.
    Off(Cause),
    /// ALTER is interrupted: the exception subroutine runs.
    Interrupted,
    /// ALTER runs, and the robot brakes the arm or has stopped it.
    Halted,
    /// The hand moves nothing until it has rested.
    Disarmed(Cause),
    /// The hand rests, and has not rested long enough.
    Resting {
        /// The reason that the hand has to rest.
        cause: Cause,
        /// The time until which the hand's values may be used.
        fresh_until: Duration,
        /// The time at which the hand has rested long enough.
        rested_at: Duration,
    },
    /// The hand has rested; a key has to confirm it.
    Ready {
        /// The reason that the hand had to rest.
        cause: Cause,
        /// The time until which the hand's values may be used.
        fresh_until: Duration,
    },
    /// The hand moves the arm.
    Armed {
        /// The time until which the hand's values may be used.
        fresh_until: Duration,
    },
    /// The operator has stopped: the values go to zero, then ALTER ends.
    Stopping,
    /// The program is to end: the values go to zero, then ALTER ends.
    Ending {
        /// The time at which the program ends at the latest.
        by: Duration,
    },
    /// The program ends now.
    Ended,
}

/// The reason that the hand does not move the arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Cause {
    /// No ALTER runs that could move the arm.
    NoAlter,
    /// ALTER has begun.
    Start,
    /// ALTER was interrupted.
    Interruption,
    /// The robot has stopped the arm.
    Halt,
    /// The input sends no new values.
    OldValues,
    /// The input device is gone.
    InputLost,
    /// The key that must be held was let go.
    KeyReleased,
    /// The meaning of the hand's values has changed.
    Profile,
    /// The operator has stopped.
    Stop,
}

/// An input of the latch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LatchInput {
    /// ALTER begins: a start message has come.
    Connected,
    /// ALTER is over, or the port is gone.
    Disconnected,
    /// A deadline may have passed.
    Timeout,
    /// Messages of a running ALTER are to be answered with values.
    Running,
    /// The exception subroutine runs.
    Interrupted,
    /// ALTER runs, and the robot brakes the arm or has stopped it: a fault, a panic stop, a signal, its program.
    Halted,
    /// No message is answered any more.
    Silent,
    /// New values of the hand.
    Hand {
        /// Whether no axis is beyond the dead zone.
        rests: bool,
        /// Whether the key to be held is pressed.
        holds: bool,
        /// The time until which the values may be used.
        fresh_until: Duration,
    },
    /// The input sends no new values.
    OldValues,
    /// The input device is gone.
    InputLost,
    /// The meaning of the values has changed.
    Profile,
    /// The operator confirms that the hand may move the arm.
    Confirm,
    /// The operator stops the arm and ends ALTER.
    Stop,
    /// The program is to end.
    End,
}

/// An action of the latch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LatchAction {
    /// The caller has nothing to do.
    Nothing,
    /// Shows the state of the latch.
    Report,
    /// Ends ALTER, and shows the state of the latch.
    Stop,
}

/// The values that the latch permits: the last values of the hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct HandValues;

impl Latch {
    /// Before the first ALTER.
    pub const NEW: Self = Self::Off(Cause::NoAlter);

    /// Takes an input, each of which may come at any time.
    pub fn on(&mut self, now: Duration, input: LatchInput, config: &LatchConfig) -> LatchAction {
        let (before, keeps) = (*self, |rule| config.keeps(rule));
        if input == LatchInput::Timeout || keeps(Rule::TimeFirst) {
            self.expire(now, config);
        }
        if input.disarms_by().is_none_or(keeps) {
            *self = self.after(now, input, config);
        }
        let changed = (before.name(), before.cause()) != (self.name(), self.cause());
        match input {
            LatchInput::Stop | LatchInput::End if keeps(Rule::PassOnStop) => LatchAction::Stop,
            _ if changed && keeps(Rule::Report) => LatchAction::Report,
            _ => LatchAction::Nothing,
        }
    }

    /// Returns whether the hand's values may be used.
    pub fn is_armed(&self, now: Duration) -> bool {
        matches!(self, Self::Armed { fresh_until } if !is_due(*fresh_until, now))
    }

    /// Returns whether ALTER is active.
    pub fn is_on(&self) -> bool {
        !matches!(self, Self::Off(_) | Self::Ended)
    }

    /// Returns the reason that the hand does not move the arm; `None` if it moves the arm.
    pub fn cause(&self) -> Option<Cause> {
        match *self {
            Self::Off(cause)
            | Self::Disarmed(cause)
            | Self::Resting { cause, .. }
            | Self::Ready { cause, .. } => Some(cause),
            Self::Interrupted => Some(Cause::Interruption),
            Self::Halted => Some(Cause::Halt),
            Self::Armed { .. } => None,
            Self::Stopping | Self::Ending { .. } | Self::Ended => Some(Cause::Stop),
        }
    }

    fn after(self, now: Duration, input: LatchInput, config: &LatchConfig) -> Self {
        use LatchInput as On;
        let keeps = |rule| config.keeps(rule);
        match (self, input) {
            (Self::Ended, _) => Self::Ended,
            (Self::Off(_), On::End) => Self::Ended,
            (Self::Ending { by }, On::End) => Self::Ending { by },
            (_, On::End) if !keeps(Rule::EndInTime) => Self::Ending { by: Duration::MAX },
            (_, On::End) => Self::Ending { by: now.saturating_add(config.end_within) },
            (Self::Ending { .. }, On::Connected | On::Disconnected) => Self::Ended,
            (Self::Ending { by }, On::Silent) if keeps(Rule::Farewell) => {
                Self::Ending { by: by.min(now.saturating_add(config.farewell)) }
            }
            (Self::Ending { .. }, On::Running) if !keeps(Rule::EndHolds) => Self::Disarmed(Cause::Stop),
            (
                Self::Ending { by },
                On::Running
                | On::Interrupted
                | On::Halted
                | On::Silent
                | On::Hand { .. }
                | On::OldValues
                | On::InputLost
                | On::Profile
                | On::Confirm
                | On::Stop
                | On::Timeout,
            ) => Self::Ending { by },
            (Self::Off(_), On::Stop) => Self::Off(Cause::Stop),
            (_, On::Stop) => Self::Stopping,
            (Self::Stopping, On::Connected | On::Disconnected) => Self::Off(Cause::Stop),
            (Self::Stopping, On::Running) if !keeps(Rule::StopHolds) => Self::Disarmed(Cause::Stop),
            (
                Self::Stopping,
                On::Running
                | On::Interrupted
                | On::Halted
                | On::Silent
                | On::Hand { .. }
                | On::OldValues
                | On::InputLost
                | On::Profile
                | On::Confirm
                | On::Timeout,
            ) => Self::Stopping,
            (Self::Off(cause), On::Connected | On::Disconnected | On::Silent) if keeps(Rule::StopIsCause) => {
                Self::Off(cause)
            }
            (_, On::Connected | On::Disconnected | On::Silent) => Self::Off(Cause::NoAlter),
            (_, On::Interrupted) => Self::Interrupted,
            (_, On::Halted) => Self::Halted,
            (Self::Interrupted, On::Running) => Self::Disarmed(Cause::Interruption),
            (Self::Halted, On::Running) => Self::Disarmed(Cause::Halt),
            (Self::Off(_), On::Running) => Self::Disarmed(Cause::Start),
            (state, On::Running | On::Timeout) => state,
            (
                Self::Off(_) | Self::Interrupted | Self::Halted,
                On::Hand { .. } | On::OldValues | On::InputLost | On::Profile | On::Confirm,
            ) => self,
            (Self::Disarmed(cause), On::OldValues) => Self::Disarmed(cause),
            (Self::Resting { .. } | Self::Ready { .. } | Self::Armed { .. }, On::OldValues) => {
                Self::Disarmed(Cause::OldValues)
            }
            (_, On::InputLost) => Self::Disarmed(Cause::InputLost),
            (_, On::Profile) => Self::Disarmed(Cause::Profile),
            (Self::Ready { fresh_until, .. }, On::Confirm) => Self::Armed { fresh_until },
            (Self::Resting { fresh_until, .. }, On::Confirm) if !keeps(Rule::ConfirmRested) => {
                Self::Armed { fresh_until }
            }
            (state, On::Confirm) => state,
            (state, On::Hand { rests, holds, fresh_until }) => {
                state.hand(now, rests, holds, fresh_until, config)
            }
        }
    }

    fn hand(
        self,
        now: Duration,
        rests: bool,
        holds: bool,
        fresh_until: Duration,
        config: &LatchConfig,
    ) -> Self {
        let keeps = |rule| config.keeps(rule);
        if is_due(fresh_until, now) && keeps(Rule::OldOnArrival) {
            return match self {
                Self::Disarmed(cause) => Self::Disarmed(cause),
                _ => Self::Disarmed(Cause::OldValues),
            };
        }
        let holds = holds || !config.hold_to_run || !keeps(Rule::HoldToRun);
        let goes_on = rests || !keeps(Rule::Uninterrupted);
        match self {
            Self::Armed { .. } if rests || holds => Self::Armed { fresh_until },
            Self::Armed { .. } => Self::Disarmed(Cause::KeyReleased),
            Self::Disarmed(cause) if rests => {
                let rest = if keeps(Rule::Rest) { config.rest } else { Duration::ZERO };
                Self::Resting { cause, fresh_until, rested_at: now.saturating_add(rest) }
            }
            Self::Resting { cause, rested_at, .. } if goes_on && is_due(rested_at, now) => {
                if config.confirm && keeps(Rule::Confirm) {
                    Self::Ready { cause, fresh_until }
                } else {
                    Self::Armed { fresh_until }
                }
            }
            Self::Resting { cause, rested_at, .. } if goes_on => {
                Self::Resting { cause, fresh_until, rested_at }
            }
            Self::Ready { cause, .. } if goes_on => Self::Ready { cause, fresh_until },
            Self::Resting { cause, .. } | Self::Ready { cause, .. } => Self::Disarmed(cause),
            other => other,
        }
    }

    fn expire(&mut self, now: Duration, config: &LatchConfig) {
        *self = match *self {
            Self::Armed { fresh_until } if is_due(fresh_until, now) && !config.keeps(Rule::Expire) => {
                Self::Armed { fresh_until: Duration::MAX }
            }
            Self::Resting { fresh_until, .. }
            | Self::Ready { fresh_until, .. }
            | Self::Armed { fresh_until }
                if is_due(fresh_until, now) =>
            {
                Self::Disarmed(Cause::OldValues)
            }
            Self::Resting { fresh_until, rested_at, .. }
                if is_due(rested_at, now) && !config.keeps(Rule::ByValues) =>
            {
                Self::Armed { fresh_until }
            }
            Self::Ending { by } if is_due(by, now) => Self::Ended,
            state => state,
        };
    }
}

impl LatchInput {
    /// Returns the rule by which the input disarms, in any state.
    fn disarms_by(self) -> Option<Rule> {
        match self {
            Self::Connected => Some(Rule::Start),
            Self::Disconnected | Self::Silent => Some(Rule::Over),
            Self::Interrupted => Some(Rule::Interruption),
            Self::Halted => Some(Rule::Halt),
            Self::OldValues => Some(Rule::OldValues),
            Self::InputLost => Some(Rule::InputLost),
            Self::Profile => Some(Rule::Profile),
            Self::Timeout | Self::Running | Self::Hand { .. } | Self::Confirm | Self::Stop | Self::End => {
                None
            }
        }
    }
}

impl Machine for Latch {
    const END: &'static str = "latch";
    const EXPIRY: Expiry = Expiry::First;
    type Input = LatchInput;
    type Action = LatchAction;
    type Transmit = HandValues;
    type Config = LatchConfig;

    fn on(
        &mut self,
        now: Duration,
        input: LatchInput,
        config: &LatchConfig,
    ) -> Result<LatchAction, Unexpected> {
        Ok(Self::on(self, now, input, config))
    }

    /// Returns the values to send. The arm follows the hand's last values as long as it is due, and otherwise comes to rest.
    fn transmit(&self, now: Duration, config: &LatchConfig) -> Option<HandValues> {
        let is_armed = match self {
            Self::Armed { .. } if !config.keeps(Rule::FreshInUse) => true,
            _ => self.is_armed(now),
        };
        is_armed.then_some(HandValues)
    }

    fn deadline(&self) -> Option<Duration> {
        let at = match *self {
            Self::Resting { fresh_until, .. }
            | Self::Ready { fresh_until, .. }
            | Self::Armed { fresh_until } => fresh_until,
            Self::Ending { by } => by,
            Self::Off(_)
            | Self::Interrupted
            | Self::Halted
            | Self::Disarmed(_)
            | Self::Stopping
            | Self::Ended => {
                return None;
            }
        };
        (at < Duration::MAX).then_some(at)
    }

    fn expires(&self, now: Duration) -> bool {
        self.deadline().is_some_and(|at| is_due(at, now))
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        match self {
            Self::Resting { fresh_until, rested_at, .. } => {
                f(fresh_until);
                f(rested_at);
            }
            Self::Ready { fresh_until, .. } | Self::Armed { fresh_until } => f(fresh_until),
            Self::Ending { by } => f(by),
            Self::Off(_)
            | Self::Interrupted
            | Self::Halted
            | Self::Disarmed(_)
            | Self::Stopping
            | Self::Ended => {}
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Off(_) => "Off",
            Self::Interrupted => "Interrupted",
            Self::Halted => "Halted",
            Self::Disarmed(_) => "Disarmed",
            Self::Resting { .. } => "Resting",
            Self::Ready { .. } => "Ready",
            Self::Armed { .. } => "Armed",
            Self::Stopping => "Stopping",
            Self::Ending { .. } => "Ending",
            Self::Ended => "Ended",
        }
    }
}

robot_session::inputs!(LatchInput: Running, Interrupted, Halted, Silent,
    Hand { rests: true } as "Hand(rests)", Hand { rests: false, holds: true } as "Hand(pushes, holds)",
    Hand { rests: false, holds: false } as "Hand(pushes)",
    OldValues, InputLost, Profile, Confirm, Stop, End);

#[cfg(test)]
mod tests;
