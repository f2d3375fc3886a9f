//! Both machines and the line between them.
//!
//! A tick is 5 ms at 13,000 baud: poll and packet take two. What is followed is the age of values, from the sensor through the
//! line to whoever uses them.

use core::time::Duration;

use crate::model::{Edge, Edges, System, age, drive};
use isra_ball::ball::machine::{self as ball, BallMachine};
use isra_ball::host::machine::{self as host, HostMachine};
use robot_session::end::Machine as _;

use super::world::{Act, Exchange, Fate, LINE, Packet, State, TICK};

pub(super) const AGE: &str = "values are used no longer than max_age";
pub(super) const FOUND_OUT: &str =
    "with another fault values that are too old are used no longer than max_age";
pub(super) const MEASURED: &str = "values are used only if they were measured";
pub(super) const STALE: &str = "who uses values learns when they are stale";
pub(super) const ONE_OUTCOME: &str = "a poll has one outcome";
pub(super) const PAIRED: &str = "a packet is the reply to the poll that it ends";
pub(super) const ASKED: &str = "the ball sends nothing unasked";
pub(super) const CLAIMED: &str = "without a fault nothing is missed, stale or unasked";
const EXPECTED: &str = "no input is unexpected";

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
            said: false,
            too_old: 0,
            faults: 0,
            wrong: None,
        };
        self.host(&mut state, host::Input::Connected, &mut None);
        self.ball(&mut state, ball::Input::Connected, &mut None);
        state
    }

    fn acts(&self, state: &State, acts: &mut Vec<Act>) {
        let faulty = state.faults < self.faults;
        if self.replies(state) {
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
            if state.host.expires(Duration::ZERO) {
                return acts.push(Act::Timer);
            }
            if state.up.first().is_some_and(|packet| packet.ticks == 0) {
                return acts.push(Act::Receive);
            }
            if state.host.transmit(Duration::ZERO, &self.config.0).is_some() {
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
            if self.noise && !self.replies(state) {
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
                self.host(state, host::Input::Sent, edges);
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
        if state.too_old > self.config.max_age() {
            broken.push(FOUND_OUT);
        }
        let is_alone = !self.is_late() || state.faults == 0;
        if is_alone && !until.is_zero() && u32::from(age) * TICK + until > self.config.0.max_age + slack {
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
        if self.is_late() {
            return state.said && !state.asleep;
        }
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
            return Some(host::Action::Nothing);
        };
        match action {
            host::Action::Sent => state.open = true,
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
            host::Action::Unasked => {
                state.said = self.is_late();
                self.alarm(state);
            }
            host::Action::Nothing => {}
        }
        Some(action)
    }

    /// What came due comes first.
    fn expire(&self, state: &mut State, edges: &mut Edges<'_>) {
        while state.host.expires(Duration::ZERO) {
            self.host(state, host::Input::Timeout, edges);
        }
    }

    fn end(&self, state: &mut State) {
        if !core::mem::take(&mut state.open) {
            state.wrong = Some(ONE_OUTCOME);
        }
    }

    fn alarm(&self, state: &mut State) {
        if state.faults == 0 && !self.idle && !self.is_late() {
            state.wrong = Some(CLAIMED);
        }
    }

    fn ball(&self, state: &mut State, input: ball::Input, edges: &mut Edges<'_>) -> Option<bool> {
        match drive(&mut state.ball, input, &self.ball, edges) {
            Ok(ball::Action::Sent { fresh }) => Some(fresh),
            Ok(ball::Action::Nothing | ball::Action::Ignore) => None,
            Err(_) => {
                state.wrong = Some(EXPECTED);
                None
            }
        }
    }

    fn replies(&self, state: &State) -> bool {
        state.ball.transmit(Duration::ZERO, &self.ball).is_some()
    }

    fn ask(&self, state: &mut State, edges: &mut Edges<'_>) {
        if !self.replies(state) {
            state.waits = 0;
        }
        self.ball(state, ball::Input::Enquiry, edges);
        state.asked = true;
    }

    fn reply(&self, state: &mut State, fate: Fate, edges: &mut Edges<'_>) {
        let Some(fresh) = self.ball(state, ball::Input::Sent, edges) else { return };
        if !core::mem::take(&mut state.asked) {
            state.wrong = Some(ASKED);
        }
        state.waits = 0;
        if let Fate::Late(late) = fate {
            // A stream keeps its order.
            let last = state.up.last().map_or(0, |packet| packet.ticks);
            let ticks = (LINE + late + self.lag).max(last);
            let (age, measured) = (state.age, state.measured);
            state.up.push(Packet { ticks, fresh, age, measured, reply: state.open });
        }
    }

    fn receive(&self, state: &mut State, packet: Packet, edges: &mut Edges<'_>) {
        let action = self.host(state, host::Input::Packet { fresh: packet.fresh }, edges);
        if action == Some(host::Action::New) {
            state.using = Some((packet.age, packet.measured));
        }
        if matches!(action, Some(host::Action::New | host::Action::Old))
            && !packet.reply
            && !self.noise
            && !self.is_late()
        {
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
        let in_use = state.host.live_until().is_some_and(|until| !until.is_zero());
        let is_too_old = in_use && matches!(state.using, Some((age, _)) if age > self.config.max_age());
        state.too_old = if self.is_late() && is_too_old { state.too_old.saturating_add(1) } else { 0 };
        if self.replies(state) {
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
