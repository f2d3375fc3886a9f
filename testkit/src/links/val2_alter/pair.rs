//! Both machines, the line between them, and the people at either end, as a system that is explored.

use core::time::Duration;

use robot_session::end::{Machine as _, Rules};
use val2_alter::controller::machine::{self as controller, ControllerMachine, ControllerPhase, Progress};
use val2_alter::host::machine::{self as host, Answer, Course, HostMachine, HostPhase};
use val2_alter::{AXES, ErrorCode, Exception, ExceptionOutcome, Policy, StartCode, timing};

use super::setup::{Alter, FRESH, TICK};
use super::world::{
    DONE, EXPECTED, FITS, GRIP, INVENTED_MODE, Job, Message, NOT_DONE, ONCE, OUTCOME, Reply, SILENCE, SILENT,
    STALE, Stop, World, on_the_line,
};
use crate::model::{Edge, Edges, System, age};

/// What the line makes of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Fate {
    /// It arrives.
    Good,
    /// It does not.
    Lost,
    /// It is no message any more.
    Corrupt,
    /// It arrives late, or is read late.
    Late,
}

/// One thing that happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Act {
    /// The controller sends what is due.
    Send(Fate),
    /// The host reads it.
    Read,
    /// The host answers.
    Answer(Fate),
    /// The answer arrives.
    Arrive,
    /// Bytes that nobody sent arrive at the controller.
    Noise,
    /// The caller has an exception.
    Ask,
    /// The caller sets a target: bit *i*, axis *i* moves.
    Target(u8),
    /// The caller stops.
    Stop,
    /// The caller accepts ALTER again.
    Accept,
    /// The subroutine returns.
    Return,
    /// The controller interrupts ALTER by itself.
    Interrupt,
    /// The program executes its ALTER instruction.
    Start,
    /// The program ends ALTER.
    Finish,
    /// The operator ends a program whose host does not answer.
    End,
    /// The host loses its memory.
    RestartHost,
    /// The controller loses its memory.
    RestartController,
    /// The port of the host is lost and is back.
    Reopen,
    /// A quarter of a cycle.
    Tick,
    /// The same, and an answer that is due has to wait.
    LateTick,
}

impl System for Alter {
    type State = World;
    type Act = Act;

    fn init(&self) -> World {
        let mut host = HostMachine::new(Policy::Accept, true);
        let mut controller = ControllerMachine::NEW;
        let _ = host.on(Duration::ZERO, host::Input::Connected, &self.host);
        let _ = controller.on(Duration::ZERO, controller::Input::Connected, &self.controller);
        World {
            host,
            controller,
            down: Vec::new(),
            up: Vec::new(),
            late: false,
            faults: self.faults,
            jobs: Vec::new(),
            target: (0, FRESH),
            offset: (0, 0),
            stop: Stop::NotYet,
            held: 0,
            quiet: 0,
            corrupt: (0, 0),
            attempts: 0,
            unreported: false,
            broken: None,
        }
    }

    fn acts(&self, world: &World, acts: &mut Vec<Act>) {
        let faulty = world.faults > 0;
        let fates = |each: fn(Fate) -> Act, acts: &mut Vec<Act>| {
            acts.push(each(Fate::Good));
            if faulty {
                acts.extend([Fate::Lost, Fate::Corrupt, Fate::Late].map(each));
            }
        };
        if faulty {
            acts.extend([Act::RestartHost, Act::RestartController, Act::Reopen]);
            if matches!(world.controller.phase, ControllerPhase::On(_)) {
                acts.push(Act::Finish);
            }
            if world.in_window() {
                acts.push(Act::Noise);
            }
        }
        if world.controller.transmit(Duration::ZERO, &self.controller).is_some() {
            if self.interrupts && faulty && world.controller.name() == "running" {
                acts.push(Act::Interrupt);
            }
            return fates(Act::Send, acts);
        }
        if let Some((_, 0)) = world.down.first() {
            return acts.push(Act::Read);
        }
        if let Some((_, 0)) = world.up.first() {
            return acts.push(Act::Arrive);
        }
        if world.jobs.len() < self.jobs.into() && !world.open_job() && world.is_running() {
            acts.push(Act::Ask);
        }
        if let Some(wanted) = world.host.transmit(Duration::ZERO, &self.host) {
            fates(Act::Answer, acts);
            if world.late {
                acts.retain(|act| *act != Act::Answer(Fate::Late));
            }
            if faulty {
                acts.push(Act::LateTick);
            }
            if matches!(wanted, Answer::Reply { .. }) && world.is_running() && world.target.1 > 0 {
                acts.extend((0..=3).map(Act::Target));
            }
            return;
        }
        match world.stop {
            Stop::NotYet if matches!(world.host.name(), "running" | "interrupted") => acts.push(Act::Stop),
            Stop::Reported | Stop::Over if world.host.policy == Policy::Ignore => acts.push(Act::Accept),
            Stop::NotYet | Stop::Asked | Stop::Reported | Stop::Over => {}
        }
        if self.operator
            && matches!(world.host.name(), "idle" | "silent")
            && world.controller.name() == "running"
        {
            acts.push(Act::End);
        }
        match &world.controller.phase {
            ControllerPhase::Off => acts.push(Act::Start),
            ControllerPhase::On(alter) => {
                if matches!(alter.progress, Progress::Interrupted { returned: false, .. }) {
                    acts.push(Act::Return);
                }
            }
            ControllerPhase::Disconnected => {}
        }
        acts.push(Act::Tick);
    }

    fn step(&self, state: &World, act: Act, edges: Option<&mut Vec<Edge>>) -> World {
        let mut world = state.clone();
        let mut edges: Edges<'_> = edges;
        let edges = &mut edges;
        world.faults -= u8::from(is_fault(act));
        match act {
            Act::Send(fate) => {
                let len = world
                    .controller
                    .transmit(Duration::ZERO, &self.controller)
                    .map_or(0, |due| Message::from(due).len());
                let action = world.controller(self, controller::Input::Sent { len }, edges);
                if let controller::Action::Sent(message) = action {
                    let message = Message::from(message);
                    let ticks = on_the_line(len.into(), self.controller.baud);
                    world.late = fate == Fate::Late && self.late_once;
                    self.carry(&mut world.down, message, Message::Corrupt, fate, ticks);
                }
            }
            Act::Read => {
                let (message, _) = world.down.remove(0);
                world.read(self, message, edges);
            }
            Act::Answer(fate) => self.answer(&mut world, fate, edges),
            Act::Arrive => {
                let (reply, _) = world.up.remove(0);
                world.arrive(self, reply, edges);
            }
            Act::Noise => _ = world.controller(self, controller::Input::Corrupt(ErrorCode::Mark), edges),
            Act::Ask => {
                world.jobs.push(Job::default());
                let input = host::Input::Exception { exception: GRIP, has_room: true };
                if matches!(world.host(self, input, edges), host::Action::Refuse(_)) {
                    world.fail(EXPECTED);
                }
            }
            Act::Target(moving) => {
                world.host(self, host::Input::Target, edges);
                world.target = (moving, 0);
            }
            Act::Stop => {
                world.stop = Stop::Asked;
                world.host(self, host::Input::Stop, edges);
            }
            Act::Accept => _ = world.host(self, host::Input::Policy(Policy::Accept), edges),
            Act::Return => _ = world.controller(self, controller::Input::Return, edges),
            Act::Interrupt => _ = world.controller(self, controller::Input::Interrupt, edges),
            Act::Start => _ = world.controller(self, controller::Input::Start { has_room: true }, edges),
            Act::Finish | Act::End => _ = world.controller(self, controller::Input::Finish, edges),
            Act::RestartHost => {
                world.host = HostMachine::new(Policy::Accept, true);
                (world.offset, world.corrupt) = ((0, 0), (0, 0));
                if let Some(job) = world.jobs.last_mut() {
                    job.abandoned |= job.outcome.is_none();
                }
                if world.stop == Stop::Asked {
                    world.stop = Stop::Over;
                }
                world.host(self, host::Input::Connected, edges);
            }
            Act::RestartController => {
                world.controller = ControllerMachine::NEW;
                (world.held, world.attempts, world.unreported) = (0, 0, false);
                world.controller(self, controller::Input::Connected, edges);
            }
            Act::Reopen => {
                world.host(self, host::Input::Disconnected, edges);
                world.host(self, host::Input::Connected, edges);
                world.corrupt = (0, 0);
            }
            Act::Tick | Act::LateTick => self.tick(&mut world, edges),
        }
        if world.stop == Stop::Reported && world.host.policy == Policy::Accept {
            world.stop = Stop::Over;
        }
        if !matches!(world.host.phase, HostPhase::Active(_)) {
            world.quiet = 0;
        }
        if world.target.1 >= FRESH {
            // Which one it was decides nothing any more, unless the rule does not apply.
            world.target.0 &= if self.host.rules == Rules::ALL { 0 } else { 3 };
        }
        world
    }

    fn broken(&self, world: &World, broken: &mut Vec<&'static str>) {
        broken.extend(world.broken);
        for job in &world.jobs {
            if job.executed > 1 {
                broken.push(ONCE);
            }
            match job.outcome {
                Some(ExceptionOutcome::Done) if job.executed == 0 => broken.push(DONE),
                Some(ExceptionOutcome::NotDone) if job.executed > 0 => broken.push(NOT_DONE),
                _ => {}
            }
        }
        if world.open_job() && !world.has_pending() {
            broken.push(OUTCOME);
        }
        if self.other_mode && matches!(world.host.phase, HostPhase::Active(_)) {
            broken.push(INVENTED_MODE);
        }
    }

    fn benign(&self, world: &World) -> Option<Act> {
        let mut acts = Vec::new();
        self.acts(&World { faults: 0, ..world.clone() }, &mut acts);
        let last = |act: &&Act| !matches!(act, Act::Target(_) | Act::Stop | Act::Tick);
        acts.iter().find(last).or(acts.last()).copied()
    }

    fn is_over(&self, world: &World) -> bool {
        let stopped = match world.stop {
            Stop::Asked => false,
            // A host that has stopped sends nothing: by that the controller ends ALTER.
            Stop::Reported => !matches!(world.controller.name(), "running" | "interrupted"),
            Stop::NotYet | Stop::Over => true,
        };
        self.other_mode
            || world.jobs.len() == usize::from(self.jobs)
                && !world.open_job()
                && stopped
                && matches!(world.host.name(), "running" | "silent" | "idle")
    }

    fn ticks(&self, act: Act) -> u32 {
        matches!(act, Act::Tick | Act::LateTick).into()
    }
}

impl Alter {
    fn answer(&self, world: &mut World, fate: Fate, edges: &mut Edges<'_>) {
        let Some(wanted) = world.host.transmit(Duration::ZERO, &self.host) else { return };
        let follows = matches!(wanted, Answer::Reply { course: Course::Target, .. });
        if follows && world.target.1 >= FRESH {
            world.fail(STALE);
        }
        let end_by = match &world.host.phase {
            HostPhase::Active(active) => active.request.map(|request| request.due.end_by),
            HostPhase::Starting { answer, .. } | HostPhase::Repeating { answer: Some(answer), .. } => {
                Some(answer.end_by)
            }
            _ => None,
        };
        let (draft, at_rest, offset) = world.draft(self, wanted);
        let selected = world.host.select(Duration::ZERO, &draft, &self.host);
        let Some((select, held)) = selected.filter(|_| wanted != Answer::Nothing) else {
            let not_sent = if wanted == Answer::Nothing { host::Input::Ignored } else { host::Input::Late };
            world.host(self, not_sent, edges);
            return world.expire_host(self, edges);
        };
        let at_rest = at_rest && draft.moving == 0;
        world.host(self, host::Input::Sent { moving: draft.moving & select, at_rest }, edges);
        let (reply, len) = match wanted {
            Answer::Nothing => return,
            Answer::Start(code) => {
                match code {
                    StartCode::Accept => world.offset = (0, 0),
                    StartCode::Refuse => world.refuse(self),
                    StartCode::Repeat => {}
                }
                (Reply::Start(code), usize::from(draft.bare))
            }
            Answer::Reply { exception, .. } => {
                if world.stop == Stop::Reported {
                    world.fail(SILENT);
                }
                world.offset = (offset.0 & !held, offset.1 & !held);
                let words = (0..AXES).filter(|axis| select >> axis & 1 != 0);
                let words: usize = words.map(|axis| usize::from(draft.words[axis])).sum();
                let job = (exception != Exception::None).then(|| world.jobs.len() as u8 - 1);
                let reply = Reply::Values { select, moving: draft.moving & !held, job };
                (reply, usize::from(draft.bare) + words)
            }
        };
        if end_by.is_some_and(|end_by| timing::transmission_time(len, self.host.baud) > end_by) {
            world.fail(FITS);
        }
        let ticks = on_the_line(len, self.host.baud);
        self.carry(&mut world.up, reply, Reply::Corrupt, fate, ticks);
    }

    fn tick(&self, world: &mut World, edges: &mut Edges<'_>) {
        age(&mut world.host, TICK);
        age(&mut world.controller, TICK);
        world.target.1 = (world.target.1 + 1).min(FRESH);
        world.corrupt.1 = (world.corrupt.1 + u8::from(world.corrupt.0 > 0)).min(self.silence());
        if world.corrupt.1 == self.silence() {
            world.corrupt = (0, 0);
        }
        let waits = world.down.iter_mut().map(|(_, wait)| wait);
        waits
            .chain(world.up.iter_mut().map(|(_, wait)| wait))
            .for_each(|wait| *wait = wait.saturating_sub(1));
        world.expire_controller(self, edges);
        world.expire_host(self, edges);
        if matches!(world.host.phase, HostPhase::Active(_)) {
            world.quiet += 1;
            if world.quiet > self.silence() {
                world.fail(SILENCE);
            }
        }
    }

    /// Puts a message on the line; a line keeps the order.
    fn carry<T: Copy>(&self, line: &mut Vec<(T, u8)>, message: T, corrupt: T, fate: Fate, ticks: u8) {
        let after = line.last().map_or(0, |(_, wait)| *wait);
        match fate {
            Fate::Good => line.push((message, ticks.max(after))),
            Fate::Lost => {}
            Fate::Corrupt => line.push((corrupt, ticks.max(after))),
            Fate::Late => line.push((message, (ticks + self.late).max(after))),
        }
    }
}

fn is_fault(act: Act) -> bool {
    match act {
        Act::Send(fate) | Act::Answer(fate) => fate != Fate::Good,
        Act::Noise
        | Act::Interrupt
        | Act::RestartHost
        | Act::RestartController
        | Act::Reopen
        | Act::Finish
        | Act::LateTick => true,
        Act::Read
        | Act::Arrive
        | Act::Ask
        | Act::Target(_)
        | Act::Stop
        | Act::Accept
        | Act::Return
        | Act::Start
        | Act::End
        | Act::Tick => false,
    }
}
