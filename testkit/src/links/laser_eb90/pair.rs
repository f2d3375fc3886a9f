//! The acts in a [`World`], and their effects.

use core::time::Duration;

use laser_eb90::Refusal;
use laser_eb90::controller::machine::{ControllerMachine, Input as ControllerInput, Receiving, Work};
use laser_eb90::host::machine::{HostLink, HostMachine, Input as HostInput};
use robot_session::end::Machine as _;

use super::step::Step;
use super::world::{Act, Fate, Faults, Found, Held, Job, Reported, Setup, World};
use crate::model::{Edge, System};

pub(super) const DONE: &str = "done: executed";
pub(super) const DONE_ONCE: &str = "done: executed once";
pub(super) const DONE_WHOLE: &str = "done: all of it";
pub(super) const REFUSED: &str = "refused: not executed";
pub(super) const ONCE: &str = "executed once at most";
pub(super) const ECHOED: &str = "echoed in time: done";
pub(super) const ONE_OUTCOME: &str = "one outcome for each frame";
pub(super) const EXPECTED: &str = "every input is expected";

impl System for Setup {
    type State = World;
    type Act = Act;

    fn init(&self) -> World {
        let (mut host, mut controller) = (HostMachine::NEW, ControllerMachine::NEW);
        let connected = [
            host.on(Duration::ZERO, HostInput::Connected, &self.host).is_ok(),
            controller.on(Duration::ZERO, ControllerInput::Connected, &self.controller).is_ok(),
        ];
        // Nobody was there before.
        host.each_time(|time| *time = Duration::ZERO);
        World {
            host,
            connected: true,
            controller,
            held: Held::Nothing,
            found: Vec::new(),
            down: Vec::new(),
            up: Vec::new(),
            executing: 0,
            faults: self.faults.most,
            jobs: vec![Job::default(); self.jobs.len()],
            submitted: 0,
            unexpected: connected != [true; 2],
        }
    }

    fn acts(&self, world: &World, acts: &mut Vec<Act>) {
        if self.is_over(world) {
            return;
        }
        let faulty = world.faults > 0;
        if matches!(world.found.first(), Some(Found::Frame(_))) && !world.is_executing() {
            acts.push(Act::Judge(Ok(())));
            if faulty && self.faults.queue_full {
                acts.push(Act::Judge(Err(Refusal::QueueFull)));
            }
            return;
        }
        if world.controller.transmit(Duration::ZERO, &self.controller).is_some() {
            return self.replies(world, acts);
        }
        if world.host.next.is_none() && usize::from(world.submitted) < self.jobs.len() {
            acts.push(Act::Submit);
            return;
        }
        let due = world.host.transmit(Duration::ZERO, &self.host).is_some();
        if due {
            self.fates(world, acts);
        } else if world.host.deadline() == Some(Duration::ZERO) && !world.is_blocked(self) {
            acts.push(Act::Timeout);
        }
        let waits = !acts.is_empty();
        if waits && faulty && self.faults.late_polls {
            acts.push(Act::LateTick);
        }
        if !waits {
            if !world.connected {
                acts.push(Act::Connect);
            }
            if matches!(world.host.link, HostLink::Held { .. }) {
                acts.push(Act::Resume);
            }
            if world.is_executing() {
                acts.push(Act::Finish(Ok(())));
            }
            if world.executing > 0 || !world.is_executing() {
                acts.push(Act::Tick);
            }
        }
        if faulty {
            self.more_faults(world, acts);
        }
    }

    fn step(&self, state: &World, act: Act, edges: Option<&mut Vec<Edge>>) -> World {
        let mut step = Step { setup: self, world: state.clone(), edges };
        step.act(act);
        step.world
    }

    fn broken(&self, world: &World, broken: &mut Vec<&'static str>) {
        let any = |bad: fn(&Job) -> bool| world.jobs.iter().any(bad);
        let done = |job: &Job| matches!(job.reported, Some(Reported::Done { .. }));
        if world.jobs.iter().any(|job| done(job) && job.executed == 0) {
            broken.push(DONE);
        }
        if any(|job| job.reported == Some(Reported::Done { unanswered: false }) && job.executed > 1) {
            broken.push(DONE_ONCE);
        }
        if world.jobs.iter().any(|job| done(job) && job.swallowed) {
            broken.push(DONE_WHOLE);
        }
        if any(|job| job.reported == Some(Reported::Refused) && job.executed > 0) {
            broken.push(REFUSED);
        }
        if !self.host.resend_on_silence && any(|job| job.executed > 1) {
            broken.push(ONCE);
        }
        if any(|job| job.echoed && matches!(job.reported, Some(Reported::Refused | Reported::Unknown))) {
            broken.push(ECHOED);
        }
        if any(|job| job.again) {
            broken.push(ONE_OUTCOME);
        }
        if world.unexpected {
            broken.push(EXPECTED);
        }
    }

    fn benign(&self, world: &World) -> Option<Act> {
        let mut acts = Vec::new();
        self.acts(world, &mut acts);
        acts.first().copied()
    }

    fn is_over(&self, world: &World) -> bool {
        let idle = matches!(world.controller.work, Work::Listening { .. })
            && world.controller.line == Receiving::Silent;
        let lines = world.down.is_empty() && world.up.is_empty() && world.found.is_empty();
        idle && lines && world.jobs.iter().all(|job| job.reported.is_some())
    }

    fn ticks(&self, act: Act) -> u32 {
        u32::from(matches!(act, Act::Tick | Act::LateTick))
    }
}

impl Setup {
    fn fates(&self, world: &World, acts: &mut Vec<Act>) {
        acts.push(Act::Send(Fate::Good));
        let faults = self.faults;
        if world.faults == 0 {
            return;
        }
        let mut add = |allowed: bool, fate| {
            if allowed {
                acts.push(Act::Send(fate))
            }
        };
        add(faults.lose, Fate::Lost);
        add(faults.corrupt, Fate::Corrupt);
        add(faults.corrupt, Fate::Headless);
        for after in 1..self.line {
            add(faults.cut, Fate::Cut { after });
            for ticks in 1..=faults.pause {
                add(true, Fate::Paused { after, ticks });
            }
        }
    }

    fn replies(&self, world: &World, acts: &mut Vec<Act>) {
        acts.push(Act::Reply(Fate::Good));
        let faults = self.faults;
        if world.faults == 0 {
            return;
        }
        let mut add = |allowed: bool, fate| {
            if allowed {
                acts.push(Act::Reply(fate))
            }
        };
        add(faults.lose_answer, Fate::Lost);
        add(faults.corrupt_answer, Fate::Corrupt);
        for ticks in 1..=faults.late {
            add(true, Fate::Late { ticks });
        }
        if faults.late_polls {
            acts.push(Act::LateTick);
        }
    }

    fn more_faults(&self, world: &World, acts: &mut Vec<Act>) {
        let Faults { fail, crash, disconnect, restart, noise, .. } = self.faults;
        let in_use = world.connected && world.jobs.iter().any(|job| job.reported.is_none());
        let in_flight = !matches!(world.host.link, HostLink::Idle { .. } | HostLink::Held { .. });
        let mut add = |allowed: bool, act| {
            if allowed {
                acts.push(act)
            }
        };
        add(fail && world.is_executing(), Act::Finish(Err(Refusal::BadParameters)));
        add(crash && in_use && in_flight, Act::Crash { cut: false });
        add(crash && in_use && in_flight, Act::Crash { cut: true });
        add(disconnect && in_use, Act::Disconnect);
        add(restart, Act::Restart);
        add(noise && world.held == Held::Nothing && world.down.is_empty(), Act::Noise);
    }
}
