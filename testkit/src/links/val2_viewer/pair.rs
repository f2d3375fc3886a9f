//! Both machines, the line between them, ALTER and the operator of the display.
//!
//! A tick is 100 ms: a packet takes one, a display cycle two.

use core::time::Duration;

use robot_session::end::Machine as _;
use val2_viewer::host::machine::{self as host, HostMachine};
use val2_viewer::workstation::machine::{self as workstation, Display, Request, WorkstationMachine};

use super::world::{
    Act, CYCLE, DRIVER, Exchange, Fate, INTERVAL, LINE, MAX_AGE, PAUSE, PILE, Packet, STALE_AFTER, State,
    TICK,
};
use crate::model::{Edge, Edges, System, age, drive};

pub(super) const ONE_OUTCOME: &str = "a request has one outcome";
pub(super) const ENDED: &str = "a request ends with its answer, and not before";
pub(super) const CREDIT: &str = "the workstation asks first, after an answer, or after a pause";
pub(super) const STALE: &str = "who looks at the picture learns when it is stale";
pub(super) const ASKED: &str = "the host sends nothing unasked";
pub(super) const PACED: &str = "at most one packet is sent in an interval";
pub(super) const PILED: &str = "requests that have piled up are answered once";
pub(super) const FRESH: &str = "no pose is sent that is too old";
pub(super) const BACKLOG: &str = "at most two packets are on the way, and one more for each fault";
pub(super) const CLAIMED: &str = "without a fault every request is answered, and nothing is stale or unasked";
const EXPECTED: &str = "no input is unexpected";

impl System for Exchange {
    type State = State;
    type Act = Act;

    fn init(&self) -> State {
        let mut state = State {
            host: HostMachine::NEW,
            workstation: WorkstationMachine::Disconnected,
            up: Vec::new(),
            requests: 0,
            piled: 0,
            since_connected: 0,
            pile_answers: 0,
            pile_asked: false,
            host_asleep: false,
            workstation_asleep: false,
            alter: true,
            unplugged: false,
            pose_age: MAX_AGE + 1,
            since_sent: INTERVAL,
            since_drawn: PAUSE,
            asked: false,
            credit: true,
            open: false,
            awaited: false,
            shown: None,
            faults: 0,
            wrong: None,
        };
        self.open_host(&mut state, &mut None);
        self.open_workstation(&mut state, &mut None);
        state
    }

    fn acts(&self, state: &State, acts: &mut Vec<Act>) {
        let faulty = state.faults < self.faults;
        if !state.workstation_asleep && self.push_workstation(state, faulty, acts)
            || !state.host_asleep && self.push_host(state, faulty, acts)
        {
            return;
        }
        let draws = !state.workstation_asleep && state.since_drawn > 0;
        if draws {
            acts.push(Act::Draw);
        }
        if !(self.steady && draws && state.since_drawn >= CYCLE) {
            acts.push(Act::Tick);
        }
        let back = [
            (state.host_asleep, Act::HostWakes),
            (state.workstation_asleep, Act::WorkstationWakes),
            (state.unplugged, Act::Plug),
            (!state.is_host_open(), Act::OpenHost),
            (!state.is_workstation_open(), Act::OpenWorkstation),
            (!self.steady, Act::Alter),
        ];
        acts.extend(back.into_iter().filter(|(is_so, _)| *is_so).map(|(_, act)| act));
        if faulty {
            acts.extend([Act::RestartHost, Act::RestartWorkstation]);
            let faults = [
                (!state.host_asleep, Act::HostSleeps),
                (!state.workstation_asleep, Act::WorkstationSleeps),
                (!state.unplugged, Act::Unplug),
                (state.is_host_open(), Act::CloseHost),
                (state.is_host_open(), Act::ReopenHost),
                (state.is_workstation_open(), Act::CloseWorkstation),
                (state.is_workstation_open(), Act::ReopenWorkstation),
                (state.requests < DRIVER, Act::NoiseAtHost),
                (state.is_workstation_open(), Act::NoiseAtWorkstation { line: false }),
                (state.is_workstation_open(), Act::NoiseAtWorkstation { line: true }),
                (self.first_host && state.up.len() < 2, Act::SendUnasked),
            ];
            acts.extend(faults.into_iter().filter(|(is_so, _)| *is_so).map(|(_, act)| act));
        }
    }

    fn step(&self, state: &State, act: Act, edges: Option<&mut Vec<Edge>>) -> State {
        let (mut next, mut edges) = (state.clone(), edges);
        let state = &mut next;
        let edges: &mut Edges<'_> = &mut edges;
        state.faults += u8::from(act.is_fault());
        match act {
            Act::HostTimer => _ = self.host(state, host::Input::Timeout, edges),
            Act::Enquire => self.enquire(state, edges),
            Act::Answer(fate) => self.answer(state, fate, edges),
            Act::SendUnasked => self.send(state, Fate::Late(0)),
            Act::Timer => self.expire(state, edges),
            Act::Draw => {
                state.credit |= state.since_drawn >= PAUSE;
                state.since_drawn = 0;
                self.workstation(state, workstation::Input::Draw, edges);
            }
            Act::Ask { arrives } => {
                self.workstation(state, workstation::Input::Sent, edges);
                if arrives && !state.unplugged {
                    state.requests = (state.requests + 1).min(DRIVER);
                }
            }
            Act::Receive => self.receive(state, edges),
            Act::Tick => self.tick(state, edges),
            Act::Alter => state.alter = !state.alter,
            Act::NoiseAtHost => state.requests += 1,
            Act::NoiseAtWorkstation { line } => self.corrupt(state, line, edges),
            Act::HostSleeps => state.host_asleep = true,
            Act::HostWakes => state.host_asleep = false,
            Act::WorkstationSleeps => state.workstation_asleep = true,
            Act::WorkstationWakes => state.workstation_asleep = false,
            Act::Unplug => state.unplugged = true,
            Act::Plug => state.unplugged = false,
            Act::RestartHost => {
                (state.host, state.pose_age) = (HostMachine::NEW, MAX_AGE + 1);
                state.host_asleep = false;
                self.open_host(state, edges);
            }
            Act::CloseHost => {
                self.host(state, host::Input::Timeout, edges);
                self.host(state, host::Input::Disconnected, edges);
                (state.asked, state.pile_asked) = (false, false);
            }
            Act::OpenHost | Act::ReopenHost => {
                state.host_asleep = false;
                self.open_host(state, edges);
            }
            Act::RestartWorkstation => {
                state.workstation = WorkstationMachine::Disconnected;
                (state.open, state.awaited, state.shown, state.since_drawn) = (false, false, None, PAUSE);
                state.workstation_asleep = false;
                self.open_workstation(state, edges);
            }
            Act::CloseWorkstation => {
                self.expire(state, edges);
                self.workstation(state, workstation::Input::Disconnected, edges);
            }
            Act::OpenWorkstation | Act::ReopenWorkstation => {
                state.workstation_asleep = false;
                self.open_workstation(state, edges);
            }
        }
        next
    }

    fn broken(&self, state: &State, broken: &mut Vec<&'static str>) {
        broken.extend(state.wrong);
        let is_waiting = matches!(
            state.workstation,
            WorkstationMachine::Connected(Display { request: Request::Waiting { .. }, .. })
        );
        if is_waiting != state.open {
            broken.push(ONE_OUTCOME);
        }
        let live = state.workstation.live_until();
        let is_late = live.is_some_and(|until| !until.is_zero()) && state.shown > Some(STALE_AFTER);
        if live.is_some() != state.shown.is_some() || is_late {
            broken.push(STALE);
        }
        if state.up.len() > 2 + usize::from(state.faults) && !self.first_host {
            broken.push(BACKLOG);
        }
    }

    fn benign(&self, state: &State) -> Option<Act> {
        let mut acts = Vec::new();
        self.acts(state, &mut acts);
        let back = |act: &&Act| match act {
            Act::HostWakes | Act::WorkstationWakes | Act::Plug | Act::OpenHost | Act::OpenWorkstation => true,
            Act::Alter => !state.alter,
            Act::Enquire | Act::Answer(Fate::Late(0)) => true,
            _ => false,
        };
        if let Some(act) = acts.iter().find(back) {
            return Some(*act);
        }
        // The operator pauses a display that is stale, until it asks again.
        let pauses = state.shown.is_none() && !self.steady;
        let waits = state.awaited && state.since_drawn < if pauses { PAUSE } else { CYCLE };
        let draws = acts.contains(&Act::Draw) && !waits;
        if draws { Some(Act::Draw) } else { acts.into_iter().find(|act| *act != Act::Draw) }
    }

    fn is_over(&self, state: &State) -> bool {
        let is_there = state.alter && !state.unplugged && !state.host_asleep && !state.workstation_asleep;
        is_there && matches!(state.shown, Some(0..=LINE)) && state.is_host_open()
    }

    fn ticks(&self, act: Act) -> u32 {
        u32::from(act == Act::Tick)
    }
}

impl Exchange {
    /// What the workstation does at once; whether there is something.
    fn push_workstation(&self, state: &State, faulty: bool, acts: &mut Vec<Act>) -> bool {
        let begin = acts.len();
        if state.workstation.expires(Duration::ZERO) {
            acts.push(Act::Timer);
        } else if state.up.first().is_some_and(|packet| packet.ticks == 0) {
            acts.push(Act::Receive);
        } else if state.workstation.transmit(Duration::ZERO, &self.workstation).is_some() {
            acts.push(Act::Ask { arrives: true });
            if faulty {
                acts.push(Act::Ask { arrives: false });
            }
        }
        acts.len() > begin
    }

    /// The same of the host.
    fn push_host(&self, state: &State, faulty: bool, acts: &mut Vec<Act>) -> bool {
        let fates = |acts: &mut Vec<Act>| {
            acts.extend((0..=self.delay).map(|late| Act::Answer(Fate::Late(late))));
            if faulty {
                acts.extend([Act::Answer(Fate::Lost), Act::Answer(Fate::Corrupt)]);
            }
        };
        if self.first_host {
            if state.requests > 0 && state.alter && state.is_host_open() {
                fates(acts);
            }
            return false;
        }
        if state.host.expires(Duration::ZERO) {
            acts.push(Act::HostTimer);
            return true;
        }
        let reads = state.requests > 0 && state.is_host_open();
        let answers = state.host.transmit(Duration::ZERO, &self.host).is_some();
        if reads {
            acts.push(Act::Enquire);
        }
        if answers {
            fates(acts);
        }
        // A pile takes its time to come out of the driver.
        let waits = state.piled > 0 && state.since_connected < PILE;
        answers || reads && !waits
    }

    fn host(&self, state: &mut State, input: host::Input, edges: &mut Edges<'_>) -> host::Action {
        let Ok(action) = drive(&mut state.host, input, &self.host, edges) else {
            state.wrong = Some(EXPECTED);
            return host::Action::Nothing;
        };
        match action {
            host::Action::Ignore | host::Action::Stale => self.alarm(state),
            host::Action::Nothing | host::Action::Accept | host::Action::Sent => {}
            // Neither end holds the other, and every packet is text.
            host::Action::HoldEnded | host::Action::Unsendable => state.wrong = Some(EXPECTED),
        }
        action
    }

    fn workstation(&self, state: &mut State, input: workstation::Input, edges: &mut Edges<'_>) {
        let Ok(action) = drive(&mut state.workstation, input, &self.workstation, edges) else {
            state.wrong = Some(EXPECTED);
            return;
        };
        match action {
            workstation::Action::Nothing => {}
            workstation::Action::Sent => {
                if !core::mem::take(&mut state.credit) && !self.first_workstation {
                    state.wrong = Some(CREDIT);
                }
                (state.open, state.awaited) = (true, true);
            }
            workstation::Action::Pose => {
                self.end(state);
                state.shown = Some(0);
            }
            workstation::Action::Unasked => self.alarm(state),
            workstation::Action::Missed => {
                self.end(state);
                self.alarm(state);
            }
            workstation::Action::Stale => {
                state.shown = None;
                self.alarm(state);
            }
            workstation::Action::HoldEnded => state.wrong = Some(EXPECTED),
            workstation::Action::Closed { missed, stale } => {
                if missed {
                    self.end(state);
                }
                if stale {
                    state.shown = None;
                }
            }
        }
    }

    /// Each thing that came due.
    fn expire(&self, state: &mut State, edges: &mut Edges<'_>) {
        while state.workstation.expires(Duration::ZERO) {
            self.workstation(state, workstation::Input::Timeout, edges);
        }
    }

    fn end(&self, state: &mut State) {
        if !core::mem::take(&mut state.open) {
            state.wrong = Some(ONE_OUTCOME);
        }
    }

    fn alarm(&self, state: &mut State) {
        if self.steady && state.faults == 0 {
            state.wrong = Some(CLAIMED);
        }
    }

    fn enquire(&self, state: &mut State, edges: &mut Edges<'_>) {
        state.requests -= 1;
        if state.piled > 0 {
            state.piled -= 1;
            state.pile_asked = true;
        }
        state.asked = true;
        self.host(state, host::Input::Enquiry, edges);
    }

    fn answer(&self, state: &mut State, fate: Fate, edges: &mut Edges<'_>) {
        if self.first_host {
            state.requests -= 1;
            return self.send(state, fate);
        }
        self.host(state, host::Input::Sent, edges);
        if !core::mem::take(&mut state.asked) {
            state.wrong = Some(ASKED);
        }
        if state.since_sent < INTERVAL {
            state.wrong = Some(PACED);
        }
        if state.pose_age > MAX_AGE {
            state.wrong = Some(FRESH);
        }
        if core::mem::take(&mut state.pile_asked) {
            state.pile_answers += 1;
            if state.pile_answers > 1 {
                state.wrong = Some(PILED);
            }
        }
        state.since_sent = 0;
        self.send(state, fate);
    }

    fn send(&self, state: &mut State, fate: Fate) {
        let (late, good) = match fate {
            Fate::Late(late) => (late, true),
            Fate::Corrupt => (0, false),
            Fate::Lost => return,
        };
        if state.unplugged {
            return;
        }
        // A stream keeps its order.
        let last = state.up.last().map_or(0, |packet| packet.ticks);
        state.up.push(Packet { ticks: (LINE + late).max(last), good });
    }

    fn receive(&self, state: &mut State, edges: &mut Edges<'_>) {
        let packet = state.up.remove(0);
        if !state.is_workstation_open() {
            return;
        }
        if packet.good {
            state.credit |= core::mem::take(&mut state.awaited);
            self.workstation(state, workstation::Input::Pose, edges);
        } else {
            self.corrupt(state, true, edges);
        }
    }

    /// A whole line was the answer, noise was not.
    fn corrupt(&self, state: &mut State, line: bool, edges: &mut Edges<'_>) {
        let was_open = state.open;
        state.credit |= state.awaited && line;
        state.awaited &= !line;
        self.workstation(state, workstation::Input::Corrupt { line }, edges);
        if was_open && state.open == line {
            state.wrong = Some(ENDED);
        }
    }

    fn tick(&self, state: &mut State, edges: &mut Edges<'_>) {
        let older = |ticks: &mut u8, most: u8| *ticks = (*ticks + 1).min(most);
        age(&mut state.host, TICK);
        age(&mut state.workstation, TICK);
        older(&mut state.pose_age, MAX_AGE + 1);
        older(&mut state.since_sent, INTERVAL);
        older(&mut state.since_drawn, PAUSE);
        older(&mut state.since_connected, PILE);
        state.up.iter_mut().for_each(|packet| packet.ticks = packet.ticks.saturating_sub(1));
        if let Some(ticks) = &mut state.shown {
            older(ticks, STALE_AFTER + 1);
        }
        if state.alter && !state.host_asleep && !self.first_host {
            self.host(state, host::Input::Timeout, edges);
            self.host(state, host::Input::Pose, edges);
            state.pose_age = 0;
        }
    }

    fn open_host(&self, state: &mut State, edges: &mut Edges<'_>) {
        self.host(state, host::Input::Timeout, edges);
        self.host(state, host::Input::Connected, edges);
        (state.asked, state.piled) = (false, state.requests);
        (state.since_connected, state.pile_answers, state.pile_asked) = (0, 0, false);
    }

    fn open_workstation(&self, state: &mut State, edges: &mut Edges<'_>) {
        self.expire(state, edges);
        self.workstation(state, workstation::Input::Connected, edges);
        (state.credit, state.awaited) = (true, false);
    }
}
