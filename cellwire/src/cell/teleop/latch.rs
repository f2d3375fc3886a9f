//! The safety latch: whether the hand may move the arm. Pure: no clock, no line, no input device.
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
//! Every start of ALTER, every interruption, old values, a lost input, a stop and a changed profile disarm. Only fresh values of
//! a hand at rest arm, uninterrupted for [`LatchConfig::rest`]: an arm never moves because something came back.

use std::time::Duration;

/// How the latch arms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LatchConfig {
    /// How long the hand must rest. Default: 0.3 s.
    pub rest: Duration,
    /// Whether a key has to confirm it besides. Default: no.
    ///
    /// Where values are offsets from the path (non-cumulative ALTER) it should be set: armed, the arm leaves the offset that is
    /// held, and goes to that of the hand.
    pub confirm: bool,
    /// Whether the arm moves only while the hand holds a key: to let it go disarms. Default: no.
    pub hold_to_run: bool,
    /// How long the end may take: coming to rest, and ending ALTER. Default: 1.5 s.
    pub end_within: Duration,
    /// How long the controller may take to report the end of ALTER when no message is answered any more. Default: 0.15 s.
    pub farewell: Duration,
}

impl Default for LatchConfig {
    fn default() -> Self {
        Self {
            rest: Duration::from_millis(300),
            confirm: false,
            hold_to_run: false,
            end_within: Duration::from_millis(1500),
            farewell: Duration::from_millis(150),
        }
    }
}

/// The latch. Every time is a deadline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Latch {
    /// No ALTER.
    Off(Cause),
    /// ALTER is interrupted.
    Interrupted,
    /// The hand moves nothing until it has rested.
    Disarmed(Cause),
    /// The hand rests.
    Resting {
        /// Why it has to.
        cause: Cause,
        /// How long its values may be used.
        fresh_until: Duration,
        /// When it has rested long enough.
        rested_at: Duration,
    },
    /// The hand has rested; a key has to confirm it.
    Ready {
        /// Why it had to.
        cause: Cause,
        /// How long its values may be used.
        fresh_until: Duration,
    },
    /// The hand moves the arm.
    Armed {
        /// How long its values may be used.
        fresh_until: Duration,
    },
    /// The operator has stopped: the values go to zero, then ALTER ends.
    Stopping,
    /// The same, and then the program ends.
    Ending {
        /// At the latest.
        by: Duration,
    },
    /// The program ends.
    Ended,
}

/// Why the hand does not move the arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Cause {
    /// No ALTER runs.
    NoAlter,
    /// ALTER has begun.
    Start,
    /// ALTER was interrupted.
    Interruption,
    /// The input sends no new values.
    OldValues,
    /// The input is gone.
    InputLost,
    /// The key that has to be held was let go.
    KeyReleased,
    /// The meaning of the hand's values has changed.
    Profile,
    /// The operator has stopped.
    Stop,
}

/// What happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LatchInput {
    /// Messages of a running ALTER are to be answered with values.
    Running,
    /// The exception subroutine runs.
    Interrupted,
    /// No message is answered any more.
    Silent,
    /// ALTER is over.
    Over,
    /// New values of the hand.
    Hand {
        /// No axis is beyond the dead zone.
        rests: bool,
        /// The key to be held is down.
        holds: bool,
        /// How long they may be used.
        fresh_until: Duration,
    },
    /// The input sends no new values.
    OldValues,
    /// The input is gone.
    InputLost,
    /// The meaning of the values has changed.
    Profile,
    /// The operator confirms that the hand may move the arm.
    Confirm,
    /// The operator stops.
    Stop,
    /// The program is to end.
    End,
    /// Time has passed.
    Timer,
}

impl Latch {
    /// Before the first ALTER.
    pub const NEW: Self = Self::Off(Cause::NoAlter);

    /// Takes an input. What the latch is afterwards is all that there is to do: nothing is sent and nothing is asked for twice.
    pub fn on(&mut self, now: Duration, input: LatchInput, config: &LatchConfig) {
        use LatchInput as On;
        self.pass_time(now);
        *self = match (*self, input) {
            (Self::Ended, _) => Self::Ended,
            (Self::Off(_), On::End) => Self::Ended,
            (Self::Ending { by }, On::End) => Self::Ending { by },
            (_, On::End) => Self::Ending { by: now.saturating_add(config.end_within) },
            (Self::Ending { .. }, On::Over) => Self::Ended,
            (Self::Ending { by }, On::Silent) => {
                Self::Ending { by: by.min(now.saturating_add(config.farewell)) }
            }
            (
                Self::Ending { by },
                On::Running
                | On::Interrupted
                | On::Hand { .. }
                | On::OldValues
                | On::InputLost
                | On::Profile
                | On::Confirm
                | On::Stop
                | On::Timer,
            ) => Self::Ending { by },
            (Self::Off(_), On::Stop) => Self::Off(Cause::Stop),
            (_, On::Stop) => Self::Stopping,
            (Self::Stopping, On::Over) => Self::Off(Cause::Stop),
            (
                Self::Stopping,
                On::Running
                | On::Interrupted
                | On::Silent
                | On::Hand { .. }
                | On::OldValues
                | On::InputLost
                | On::Profile
                | On::Confirm
                | On::Timer,
            ) => Self::Stopping,
            (Self::Off(cause), On::Over) => Self::Off(cause),
            (_, On::Over | On::Silent) => Self::Off(Cause::NoAlter),
            (_, On::Interrupted) => Self::Interrupted,
            (Self::Interrupted, On::Running) => Self::Disarmed(Cause::Interruption),
            (Self::Off(_), On::Running) => Self::Disarmed(Cause::Start),
            (state, On::Running | On::Timer) => state,
            (
                Self::Off(cause),
                On::Hand { .. } | On::OldValues | On::InputLost | On::Profile | On::Confirm,
            ) => Self::Off(cause),
            (
                Self::Interrupted,
                On::Hand { .. } | On::OldValues | On::InputLost | On::Profile | On::Confirm,
            ) => Self::Interrupted,
            (Self::Disarmed(cause), On::OldValues) => Self::Disarmed(cause),
            (Self::Resting { .. } | Self::Ready { .. } | Self::Armed { .. }, On::OldValues) => {
                Self::Disarmed(Cause::OldValues)
            }
            (_, On::InputLost) => Self::Disarmed(Cause::InputLost),
            (_, On::Profile) => Self::Disarmed(Cause::Profile),
            (Self::Ready { fresh_until, .. }, On::Confirm) => Self::Armed { fresh_until },
            (state, On::Confirm) => state,
            (state, On::Hand { rests, holds, fresh_until }) => {
                state.hand(now, rests, holds, fresh_until, config)
            }
        };
        self.pass_time(now);
    }

    /// Whether the hand's values may be used.
    pub fn is_armed(&self, now: Duration) -> bool {
        matches!(self, Self::Armed { fresh_until } if now < *fresh_until)
    }

    /// Why the hand does not move the arm; `None`: it does.
    pub fn cause(&self) -> Option<Cause> {
        match *self {
            Self::Off(cause)
            | Self::Disarmed(cause)
            | Self::Resting { cause, .. }
            | Self::Ready { cause, .. } => Some(cause),
            Self::Interrupted => Some(Cause::Interruption),
            Self::Armed { .. } => None,
            Self::Stopping | Self::Ending { .. } | Self::Ended => Some(Cause::Stop),
        }
    }

    /// The state's name.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Off(_) => "off",
            Self::Interrupted => "interrupted",
            Self::Disarmed(_) => "disarmed",
            Self::Resting { .. } => "resting",
            Self::Ready { .. } => "ready",
            Self::Armed { .. } => "armed",
            Self::Stopping => "stopping",
            Self::Ending { .. } => "ending",
            Self::Ended => "ended",
        }
    }

    /// When [`LatchInput::Timer`] is to come.
    pub fn deadline(&self) -> Option<Duration> {
        match *self {
            Self::Resting { fresh_until, .. }
            | Self::Ready { fresh_until, .. }
            | Self::Armed { fresh_until } => Some(fresh_until),
            Self::Ending { by } => Some(by),
            Self::Off(_) | Self::Interrupted | Self::Disarmed(_) | Self::Stopping | Self::Ended => None,
        }
    }

    /// Visits every time in the state.
    pub fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        match self {
            Self::Resting { fresh_until, rested_at, .. } => {
                f(fresh_until);
                f(rested_at);
            }
            Self::Ready { fresh_until, .. } | Self::Armed { fresh_until } => f(fresh_until),
            Self::Ending { by } => f(by),
            Self::Off(_) | Self::Interrupted | Self::Disarmed(_) | Self::Stopping | Self::Ended => {}
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
        if fresh_until <= now {
            return match self {
                Self::Disarmed(cause) => Self::Disarmed(cause),
                _ => Self::Disarmed(Cause::OldValues),
            };
        }
        match self {
            Self::Armed { .. } if rests || holds || !config.hold_to_run => Self::Armed { fresh_until },
            Self::Armed { .. } => Self::Disarmed(Cause::KeyReleased),
            Self::Disarmed(cause) if rests => {
                Self::Resting { cause, fresh_until, rested_at: now.saturating_add(config.rest) }
            }
            // By new values alone: time itself arms nothing, for a push may have come that is not read yet.
            Self::Resting { cause, rested_at, .. } if rests && now >= rested_at => {
                if config.confirm {
                    Self::Ready { cause, fresh_until }
                } else {
                    Self::Armed { fresh_until }
                }
            }
            Self::Resting { cause, rested_at, .. } if rests => {
                Self::Resting { cause, fresh_until, rested_at }
            }
            Self::Ready { cause, .. } if rests => Self::Ready { cause, fresh_until },
            Self::Resting { cause, .. } | Self::Ready { cause, .. } => Self::Disarmed(cause),
            other => other,
        }
    }

    fn pass_time(&mut self, now: Duration) {
        *self = match *self {
            Self::Resting { fresh_until, .. }
            | Self::Ready { fresh_until, .. }
            | Self::Armed { fresh_until }
                if fresh_until <= now =>
            {
                Self::Disarmed(Cause::OldValues)
            }
            Self::Ending { by } if by <= now => Self::Ended,
            state => state,
        };
    }
}

#[cfg(test)]
#[path = "latch_tests.rs"]
mod tests;
