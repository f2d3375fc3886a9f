//! The latch among people and devices that do anything at any time.
//!
//! The model has the knowledge of a person who watches everything: the robot's last report, the time for which the
//! hand has rested, the operator's requests, and the latch's reports. It has nothing of the latch's own state.

use core::time::Duration;

use cellwire_motion::latch::{Cause, Latch, LatchAction, LatchConfig, LatchInput};
use robot_session::end::Machine as _;

use crate::model::{Edge, Edges, System, age, drive};

pub(super) const RUNS: &str = "the arm moves only in an ALTER that runs";
pub(super) const STOPPED: &str = "after a stop or an end nothing moves in this ALTER";
pub(super) const FRESH: &str = "the arm moves only by fresh values";
pub(super) const RESTED: &str =
    "the arm moves only if the hand has rested since it was last stopped by anything";
pub(super) const CONFIRMED: &str = "the arm moves only if a key has confirmed it, where one has to";
pub(super) const HELD: &str = "a push moves the arm only while the key is held, where one has to be";
pub(super) const WORKS: &str = "a hand that has rested moves the arm";
pub(super) const STOP: &str = "a stop ends ALTER in every state";
pub(super) const OPEN: &str = "a stop is shown until ALTER runs again";
pub(super) const END: &str = "the end comes in time";
pub(super) const SHOWN: &str = "what is shown is what is";
pub(super) const ARMED: &str = "what is shown as armed moves the arm";

/// The time of a tick, or of several.
pub const TICK: Duration = Duration::from_millis(50);

/// The configuration of the latch, and its times in ticks.
#[derive(Debug, Clone, Copy)]
pub struct Operated {
    /// The latch's configuration.
    pub config: LatchConfig,
    /// The program may be called late.
    pub(super) late: bool,
    pub(super) tick: Duration,
    pub(super) fresh: u8,
    pub(super) rest: u8,
    pub(super) end: u8,
    pub(super) farewell: u8,
}

impl Operated {
    /// Returns the setting with `ticks` ticks per [`TICK`].
    pub(super) fn new(ticks: u8, confirm: bool, hold_to_run: bool) -> Self {
        let tick = TICK / u32::from(ticks);
        let [fresh, rest, end, farewell] = [2, 3, 4, 1].map(|count| count * ticks);
        let time = |ticks: u8| tick * u32::from(ticks);
        let config = LatchConfig {
            rest: time(rest),
            confirm,
            hold_to_run,
            end_within: time(end),
            farewell: time(farewell),
            ..LatchConfig::default()
        };
        Self { config, late: true, tick, fresh, rest, end, farewell }
    }
}

/// The robot's last report.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Alter {
    /// No ALTER.
    Off,
    /// ALTER has begun; no values are requested yet.
    Begun,
    /// The robot requests values.
    Running,
    /// The subroutine of ALTER runs.
    Interrupted,
    /// The robot stops the arm.
    Halted,
    /// ALTER is no longer answered.
    Silent,
}

/// The state of everything.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct State {
    /// The latch.
    pub latch: Latch,
    alter: Alter,
    /// Whether the operator has stopped this ALTER.
    stopped: bool,
    /// Whether the last act of the operator about ALTER was to stop, and it did not run since.
    stop_is_last: bool,
    /// The ticks within which the program is to have ended; `None` if it is not to end.
    end: Option<u8>,
    /// The ticks for which the last values may still be used.
    fresh: u8,
    /// Whether the last values are those of a hand at rest, or one that holds its key.
    holds: bool,
    /// Ticks since the first values of the current rest; `None` without a rest.
    rested: Option<u8>,
    /// Whether the rest was long enough, and nothing was in between.
    earned: bool,
    confirmed: bool,
    shown: (&'static str, Option<Cause>),
    wrong: Option<&'static str>,
}

/// A step of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Act {
    /// Time passes, whether expired deadlines are handled or not.
    Tick,
    /// An input of the latch.
    Input(LatchInput),
    /// The program is restarted.
    Restart,
}

impl System for Operated {
    type State = State;
    type Act = Act;

    fn init(&self) -> State {
        State {
            latch: Latch::NEW,
            alter: Alter::Off,
            stopped: false,
            stop_is_last: false,
            end: None,
            fresh: 0,
            holds: false,
            rested: None,
            earned: false,
            confirmed: false,
            shown: (Latch::NEW.name(), Latch::NEW.cause()),
            wrong: None,
        }
    }

    fn acts(&self, state: &State, acts: &mut Vec<Act>) {
        use LatchInput as On;
        acts.push(Act::Restart);
        if state.latch == Latch::Ended {
            return;
        }
        if state.latch.expires(Duration::ZERO) {
            acts.push(Act::Input(On::Timeout));
            if !self.late {
                return;
            }
        }
        acts.push(Act::Tick);
        let others = [
            On::Connected,
            On::Disconnected,
            On::Running,
            On::Interrupted,
            On::Halted,
            On::Silent,
            On::OldValues,
            On::InputLost,
            On::Profile,
            On::Confirm,
            On::Stop,
            On::End,
        ];
        acts.extend(others.map(Act::Input));
        // As old as they like, when the ball, its line or the program is late.
        for left in 0..=self.fresh {
            let hands = [(true, false), (false, false), (false, true)];
            acts.extend(hands.map(|(rests, holds)| self.hand(rests, holds, left)));
        }
    }

    fn step(&self, state: &State, act: Act, mut edges: Option<&mut Vec<Edge>>) -> State {
        let mut next = state.clone();
        match act {
            Act::Tick => self.tick(&mut next),
            Act::Input(input) => self.input(&mut next, input, &mut edges),
            Act::Restart => next = self.init(),
        }
        next
    }

    fn broken(&self, state: &State, broken: &mut Vec<&'static str>) {
        broken.extend(state.wrong);
        let moves = self.moves(state);
        let runs = state.alter == Alter::Running;
        let stopped = state.stopped || state.end.is_some();
        let confirmed = state.confirmed || !self.config.confirm;
        let held = state.holds || !self.config.hold_to_run;
        let never = [
            (moves && !runs, RUNS),
            (moves && stopped, STOPPED),
            (moves && state.fresh == 0, FRESH),
            (moves && !state.earned, RESTED),
            (moves && !confirmed, CONFIRMED),
            (moves && !held, HELD),
            (!moves && runs && !stopped && state.earned && confirmed, WORKS),
            (state.stop_is_last && state.latch.cause() != Some(Cause::Stop), OPEN),
            (state.shown != (state.latch.name(), state.latch.cause()), SHOWN),
        ];
        broken.extend(never.into_iter().filter_map(|(is_so, property)| is_so.then_some(property)));
        if state.end == Some(0) && state.latch != Latch::Ended && !state.latch.expires(Duration::ZERO) {
            broken.push(END);
        }
    }

    /// Returns the act of a robot that requests values, and of a hand that rests.
    fn fault_free_step(&self, state: &State) -> Option<Act> {
        use LatchInput as On;
        Some(match state.latch {
            _ if state.latch.expires(Duration::ZERO) => Act::Input(On::Timeout),
            Latch::Off(_) | Latch::Interrupted | Latch::Halted => Act::Input(On::Running),
            Latch::Stopping | Latch::Ending { .. } => Act::Input(On::Disconnected),
            Latch::Ready { .. } => Act::Input(On::Confirm),
            Latch::Resting { fresh_until, .. } if fresh_until == self.fresh_until(self.fresh) => Act::Tick,
            Latch::Disarmed(_) | Latch::Resting { .. } | Latch::Armed { .. } | Latch::Ended => {
                self.hand(true, false, self.fresh)
            }
        })
    }

    fn is_over(&self, state: &State) -> bool {
        self.moves(state) || state.latch == Latch::Ended
    }

    fn ticks(&self, act: Act) -> u32 {
        u32::from(act == Act::Tick)
    }
}

impl Operated {
    fn moves(&self, state: &State) -> bool {
        state.latch.transmit(Duration::ZERO, &self.config).is_some()
    }

    fn fresh_until(&self, left: u8) -> Duration {
        self.tick * u32::from(left)
    }

    fn hand(&self, rests: bool, holds: bool, left: u8) -> Act {
        Act::Input(LatchInput::Hand { rests, holds, fresh_until: self.fresh_until(left) })
    }

    fn tick(&self, state: &mut State) {
        age(&mut state.latch, self.tick);
        state.fresh = state.fresh.saturating_sub(1);
        if state.fresh == 0 {
            state.forbid();
        }
        state.rested = state.rested.map(|ticks| (ticks + 1).min(self.rest));
        state.end = state.end.map(|ticks| ticks.saturating_sub(1));
    }

    fn input(&self, state: &mut State, input: LatchInput, edges: &mut Edges<'_>) {
        self.watch(state, input);
        let action = drive(&mut state.latch, input, &self.config, edges);
        let is_stop = matches!(input, LatchInput::Stop | LatchInput::End);
        if is_stop && action != Ok(LatchAction::Stop) {
            state.wrong = Some(STOP);
        }
        if matches!(action, Ok(LatchAction::Stop | LatchAction::Report)) {
            state.shown = (state.latch.name(), state.latch.cause());
            if state.latch.cause().is_none() && !self.moves(state) {
                state.wrong = Some(ARMED);
            }
        }
    }

    fn watch(&self, state: &mut State, input: LatchInput) {
        match input {
            LatchInput::Running => state.say(Alter::Running),
            LatchInput::Interrupted | LatchInput::Halted => {
                let is_halted = input == LatchInput::Halted;
                state.say(if is_halted { Alter::Halted } else { Alter::Interrupted });
                state.forbid();
            }
            LatchInput::Silent => {
                // After a stop the silence is on purpose.
                state.alter = if state.stopped { Alter::Silent } else { Alter::Off };
                state.end = state.end.map(|ticks| ticks.min(self.farewell));
                state.forbid();
            }
            LatchInput::Connected | LatchInput::Disconnected => {
                state.alter = if input == LatchInput::Connected { Alter::Begun } else { Alter::Off };
                state.stopped = false;
                state.end = state.end.map(|_| 0);
                state.forbid();
            }
            LatchInput::OldValues | LatchInput::InputLost | LatchInput::Profile => state.forbid(),
            LatchInput::Confirm => state.confirmed |= state.earned,
            LatchInput::Stop | LatchInput::End => {
                let is_on = !matches!(state.alter, Alter::Off | Alter::Begun);
                state.stopped |= is_on;
                state.stop_is_last = true;
                if input == LatchInput::End {
                    state.end.get_or_insert(if is_on { self.end } else { 0 });
                }
                state.forbid();
            }
            LatchInput::Timeout => {}
            LatchInput::Hand { rests, holds, fresh_until } => {
                state.fresh = (fresh_until.as_nanos() / self.tick.as_nanos()) as u8;
                state.holds = rests || holds;
                self.watch_hand(state, rests);
            }
        }
    }

    fn watch_hand(&self, state: &mut State, rests: bool) {
        let may_move = state.earned && (state.confirmed || !self.config.confirm);
        let runs = state.alter == Alter::Running && !state.stopped && state.end.is_none();
        let is_let_go = self.config.hold_to_run && !state.holds;
        if state.fresh == 0 || runs && (may_move && is_let_go || !may_move && !rests) {
            state.forbid();
        } else if runs && !may_move && *state.rested.get_or_insert(0) >= self.rest {
            state.earned = true;
        }
    }
}

impl State {
    /// Handles a robot that requests values, or reports that it is interrupted.
    fn say(&mut self, alter: Alter) {
        if self.alter != Alter::Silent {
            self.alter = alter;
        }
        if !self.stopped && self.end.is_none() {
            self.stop_is_last = false;
        }
    }

    /// Requires that from now on the hand rests, and is confirmed, before it moves the arm.
    fn forbid(&mut self) {
        (self.rested, self.earned, self.confirmed) = (None, false, false);
    }
}
