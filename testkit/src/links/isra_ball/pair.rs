//! Both machines and the line between them.
//!
//! A tick is 5 ms at 13,000 baud: poll and packet take two. What is followed is the age of values, from the sensor through the
//! line to whoever uses them.

use core::time::Duration;

use crate::model::{Edge, Edges, System, age, drive};
use isra_ball::ball::machine::{self as ball, BallMachine};
use isra_ball::host::machine::{self as host, HostMachine};
use isra_ball::{BallConfig, HostConfig};

/// The time of a tick.
pub const TICK: Duration = Duration::from_millis(5);
/// The ticks of a poll and its packet on the line.
const LINE: u8 = 2;

pub(super) const AGE: &str = "values are used no longer than max_age";
pub(super) const MEASURED: &str = "values are used only if they were measured";
pub(super) const STALE: &str = "who uses values learns when they are stale";
pub(super) const ONE_OUTCOME: &str = "a poll has one outcome";
pub(super) const PAIRED: &str = "a packet is the reply to the poll that it ends";
pub(super) const ASKED: &str = "the ball sends nothing unasked";
pub(super) const CLAIMED: &str = "without a fault nothing is missed, stale or unasked";
const EXPECTED: &str = "no input is unexpected";

/// A system: bounds and faults.
#[derive(Debug, Clone, Copy)]
pub struct Exchange {
    /// The host's configuration.
    pub config: Config,
    /// The ball's configuration.
    pub ball: BallConfig,
    /// So many faults at most.
    pub faults: u8,
    /// The most ticks that a packet is late.
    pub delay: u8,
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
        without: None,
    });

    pub(super) fn without(self, rule: isra_ball::host::Rule) -> Self {
        Self(HostConfig { without: Some(rule), ..self.0 })
    }

    /// Three ticks late is in time, later than the next poll is due.
    pub(super) fn patient(self) -> Self {
        let (max_delay, max_age) = (Duration::from_micros(17_500), Duration::from_millis(85));
        Self(HostConfig { max_delay, max_age, ..self.0 })
    }

    /// The greatest age in ticks.
    fn max_age(&self) -> u8 {
        (self.0.max_age.as_nanos() / TICK.as_nanos()) as u8
    }
}

impl Exchange {
    /// A ball that has new values at every tick.
    pub fn steady() -> Self {
        let (config, ball) = (Config::WHOLE, BallConfig::default());
        Self { config, ball, faults: 1, delay: 1, idle: false, noise: false, sleeps: true }
    }

    /// A ball that measures when it likes.
    pub fn slow() -> Self {
        Self { idle: true, ..Self::steady() }
    }

    /// From this age on values are just as old.
    fn oldest(&self) -> u8 {
        self.config.max_age() + self.delay + LINE + 2
    }
}

/// A packet between the ball and the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Packet {
    /// Ticks until it arrives; 0 in the host's input.
    pub ticks: u8,
    fresh: bool,
    age: u8,
    measured: bool,
    /// It answers the poll that is open.
    reply: bool,
}

/// The state of everything.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct State {
    /// The host's machine.
    pub host: HostMachine,
    /// The ball's machine.
    pub ball: BallMachine,
    /// The age of the ball's values in ticks; they were measured, or never.
    age: u8,
    measured: bool,
    /// An ENQ has come on this connection of the ball and was not answered.
    asked: bool,
    /// How long the ball has had the poll that it is to answer.
    waits: u8,
    /// On the line and in the host's input, oldest first.
    pub up: Vec<Packet>,
    asleep: bool,
    open: bool,
    /// The age of the values in use, and whether they were measured.
    using: Option<(u8, bool)>,
    faults: u8,
    wrong: Option<&'static str>,
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
    /// It arrives, so many ticks late.
    Late(u8),
    /// Nothing of it arrives.
    Lost,
    /// It arrives with a wrong checksum.
    Corrupt,
}

impl System for Exchange {
    type State = State;
    type Act = Act;

    fn init(&self) -> State {
        let mut state = State {
            host: HostMachine::Disconnected,
            ball: BallMachine::NEW,
            age: self.oldest(),
            measured: false,
            asked: false,
            waits: 0,
            up: Vec::new(),
            asleep: false,
            open: false,
            using: None,
            faults: 0,
            wrong: None,
        };
        self.host(&mut state, host::Input::Connected, &mut None);
        self.ball(&mut state, ball::Input::Connected, &mut None);
        state
    }

    fn acts(&self, state: &State, acts: &mut Vec<Act>) {
        let faulty = state.faults < self.faults;
        if state.ball.transmits() {
            acts.extend(
                (0..=self.delay.saturating_sub(state.waits)).map(|late| Act::Reply(Fate::Late(late))),
            );
            if faulty {
                acts.extend([
                    Act::Reply(Fate::Lost),
                    Act::Reply(Fate::Corrupt),
                    Act::ReopenBall,
                    Act::RestartBall,
                ]);
            }
            if state.waits >= self.delay {
                return;
            }
        }
        if !state.asleep {
            let timer = { state.host }.on(Duration::ZERO, host::Input::Timer, &self.config.0);
            if timer != Ok(host::Action::None) {
                return acts.push(Act::Timer);
            }
            if state.up.first().is_some_and(|packet| packet.ticks == 0) {
                return acts.push(Act::Receive);
            }
            if state.host.transmits(Duration::ZERO) {
                acts.push(Act::Poll { arrives: true });
                if faulty {
                    acts.push(Act::Poll { arrives: false });
                }
                return;
            }
        }
        acts.push(Act::Tick { measures: true });
        if self.idle {
            acts.push(Act::Tick { measures: false });
            if state.age > 0 || state.ball.values == ball::Values::Old {
                acts.push(Act::Measure);
            }
        }
        if state.asleep {
            acts.push(Act::Wake);
        } else if faulty && self.sleeps {
            acts.push(Act::Sleep);
        }
        if faulty {
            acts.extend([Act::RestartHost, Act::ReopenHost, Act::RestartBall, Act::OtherBall]);
            if self.noise && !state.ball.transmits() {
                acts.push(Act::Noise);
            }
        }
    }

    fn step(&self, state: &State, act: Act, edges: Option<&mut Vec<Edge>>) -> State {
        let (mut next, mut edges) = (state.clone(), edges);
        let state = &mut next;
        let edges: &mut Edges<'_> = &mut edges;
        state.faults += u8::from(act.is_fault());
        match act {
            Act::Timer => self.expire(state, edges),
            Act::Poll { arrives } => {
                self.host(state, host::Input::Poll, edges);
                state.up.iter_mut().for_each(|packet| packet.reply = false);
                if arrives {
                    self.ask(state, edges);
                }
            }
            Act::Reply(fate) => self.reply(state, fate, edges),
            Act::Receive => {
                let packet = state.up.remove(0);
                self.receive(state, packet, edges);
            }
            Act::Tick { measures } => self.tick(state, measures, edges),
            Act::Measure => self.measure(state, edges),
            Act::Noise => self.ask(state, edges),
            Act::Sleep => state.asleep = true,
            Act::Wake => state.asleep = false,
            Act::RestartHost => {
                (state.host, state.open, state.using, state.asleep) =
                    (HostMachine::Disconnected, false, None, false);
                self.host(state, host::Input::Connected, edges);
            }
            Act::ReopenHost => self.reopen_host(state, edges),
            Act::RestartBall => {
                (state.ball, state.age, state.measured) = (BallMachine::NEW, self.oldest(), false);
                self.reopen_ball(state, edges);
            }
            Act::ReopenBall => self.reopen_ball(state, edges),
            Act::OtherBall => {
                state.up.clear();
                state.ball = BallMachine { values: ball::Values::New, ..BallMachine::NEW };
                (state.age, state.measured) = (self.oldest(), true);
                self.reopen_ball(state, edges);
                state.asleep = false;
                self.expire(state, edges);
                self.host(state, host::Input::Connected, edges);
            }
        }
        next
    }

    fn broken(&self, state: &State, broken: &mut Vec<&'static str>) {
        broken.extend(state.wrong);
        let live = state.host.live_until();
        if live.is_some() != state.using.is_some() {
            broken.push(STALE);
        }
        let is_waiting =
            matches!(&state.host, HostMachine::Connected(p) if matches!(p.poll, host::Poll::Waiting { .. }));
        if is_waiting != state.open {
            broken.push(ONE_OUTCOME);
        }
        let (Some((age, measured)), Some(until)) = (state.using, live) else { return };
        // The answer to a poll that noise made may be on the line when the poll is sent that it is taken for: by so much the
        // values are older. How late it is shows only to a host that is called in time.
        let slack = match (self.noise, self.sleeps) {
            (false, _) => Duration::ZERO,
            (true, false) => self.config.0.max_delay,
            (true, true) => self.config.0.reply_window(),
        };
        if !until.is_zero() && u32::from(age) * TICK + until > self.config.0.max_age + slack {
            broken.push(AGE);
        }
        if !measured {
            broken.push(MEASURED);
        }
    }

    fn benign(&self, state: &State) -> Option<Act> {
        let mut acts = Vec::new();
        self.acts(state, &mut acts);
        acts.iter().find(|act| **act == Act::Wake).or(acts.first()).copied()
    }

    fn is_over(&self, state: &State) -> bool {
        state.host.live_until().is_some() && !state.asleep && matches!(state.using, Some((0..=LINE, _)))
    }

    fn ticks(&self, act: Act) -> u32 {
        u32::from(matches!(act, Act::Tick { .. }))
    }
}

impl Exchange {
    fn host(&self, state: &mut State, input: host::Input, edges: &mut Edges<'_>) -> Option<host::Action> {
        let action = drive(&mut state.host, input, &self.config.0, edges);
        let Ok(action) = action else {
            state.wrong = Some(EXPECTED);
            return Some(host::Action::None);
        };
        match action {
            host::Action::Transmit => state.open = true,
            host::Action::New | host::Action::Old => self.end(state),
            host::Action::Missed => {
                self.end(state);
                self.alarm(state);
            }
            host::Action::Stale => {
                state.using = None;
                self.alarm(state);
            }
            host::Action::Closed { missed, stale } => {
                if missed {
                    self.end(state);
                }
                if stale {
                    state.using = None;
                }
            }
            host::Action::Unasked => self.alarm(state),
            host::Action::None => {}
        }
        Some(action)
    }

    /// What came due comes first.
    fn expire(&self, state: &mut State, edges: &mut Edges<'_>) {
        while self.host(state, host::Input::Timer, edges) != Some(host::Action::None) {}
    }

    fn end(&self, state: &mut State) {
        if !core::mem::take(&mut state.open) {
            state.wrong = Some(ONE_OUTCOME);
        }
    }

    fn alarm(&self, state: &mut State) {
        if state.faults == 0 && !self.idle {
            state.wrong = Some(CLAIMED);
        }
    }

    fn ball(&self, state: &mut State, input: ball::Input, edges: &mut Edges<'_>) -> Option<bool> {
        match drive(&mut state.ball, input, &self.ball, edges) {
            Ok(ball::Action::Transmit { fresh }) => Some(fresh),
            Ok(ball::Action::None | ball::Action::Ignore) => None,
            Err(_) => {
                state.wrong = Some(EXPECTED);
                None
            }
        }
    }

    fn ask(&self, state: &mut State, edges: &mut Edges<'_>) {
        if !state.ball.transmits() {
            state.waits = 0;
        }
        self.ball(state, ball::Input::Enquiry, edges);
        state.asked = true;
    }

    fn reply(&self, state: &mut State, fate: Fate, edges: &mut Edges<'_>) {
        let Some(fresh) = self.ball(state, ball::Input::Reply, edges) else { return };
        if !core::mem::take(&mut state.asked) {
            state.wrong = Some(ASKED);
        }
        state.waits = 0;
        if let Fate::Late(late) = fate {
            // A stream keeps its order.
            let last = state.up.last().map_or(0, |packet| packet.ticks);
            let ticks = (LINE + late).max(last);
            let (age, measured) = (state.age, state.measured);
            state.up.push(Packet { ticks, fresh, age, measured, reply: state.open });
        }
    }

    fn receive(&self, state: &mut State, packet: Packet, edges: &mut Edges<'_>) {
        let action = self.host(state, host::Input::Packet { fresh: packet.fresh }, edges);
        if action == Some(host::Action::New) {
            state.using = Some((packet.age, packet.measured));
        }
        if matches!(action, Some(host::Action::New | host::Action::Old)) && !packet.reply && !self.noise {
            state.wrong = Some(PAIRED);
        }
    }

    fn tick(&self, state: &mut State, measures: bool, edges: &mut Edges<'_>) {
        let oldest = self.oldest();
        let older = |age: &mut u8| *age = (*age + 1).min(oldest);
        age(&mut state.host, TICK);
        older(&mut state.age);
        for packet in &mut state.up {
            packet.ticks = packet.ticks.saturating_sub(1);
            older(&mut packet.age);
        }
        if let Some((age, _)) = &mut state.using {
            older(age);
        }
        if state.ball.transmits() {
            state.waits += 1;
        }
        if measures {
            self.measure(state, edges);
        }
    }

    fn measure(&self, state: &mut State, edges: &mut Edges<'_>) {
        self.ball(state, ball::Input::Measured, edges);
        (state.age, state.measured) = (0, true);
    }

    fn reopen_host(&self, state: &mut State, edges: &mut Edges<'_>) {
        self.expire(state, edges);
        state.asleep = false;
        self.host(state, host::Input::Disconnected, edges);
        self.host(state, host::Input::Connected, edges);
    }

    fn reopen_ball(&self, state: &mut State, edges: &mut Edges<'_>) {
        self.ball(state, ball::Input::Disconnected, edges);
        self.ball(state, ball::Input::Connected, edges);
        (state.asked, state.waits) = (false, 0);
    }
}

impl Act {
    fn is_fault(self) -> bool {
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
