//! What happens in a [`World`], and what follows.

use core::time::Duration;

use laser_eb90::controller::machine::{Answer, ControllerMachine, Input as ControllerInput, Receiving, Work};
use laser_eb90::host::machine::{Action, HostLink, HostMachine, Input as HostInput, Outcome};
use laser_eb90::{Class, Refusal};
use robot_session::Machine as _;

use super::world::{
    Act, Content, Fate, Faults, Found, Held, Job, Reply, Reported, Setup, Transmission, World,
};
use crate::model::{Edge, Edges, System, age, drive};

/// More bytes than the shortest frame has, and fewer.
const MANY: u8 = 20;
const FEW: u8 = 4;

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

/// A world that an act changes.
struct Step<'a> {
    setup: &'a Setup,
    world: World,
    edges: Edges<'a>,
}

impl Step<'_> {
    fn act(&mut self, act: Act) {
        let setup = self.setup;
        let is_fault = match act {
            Act::Send(fate) | Act::Reply(fate) => fate != Fate::Good,
            Act::Judge(verdict) => verdict.is_err(),
            Act::Finish(result) => result.is_err(),
            Act::LateTick | Act::Noise | Act::Crash { .. } | Act::Disconnect | Act::Restart => true,
            Act::Tick | Act::Connect | Act::Submit | Act::Timeout | Act::Resume => false,
        };
        self.world.faults -= u8::from(is_fault);
        match act {
            Act::Tick | Act::LateTick => self.tick(),
            Act::Connect => {
                self.world.connected = true;
                self.host(HostInput::Connected);
            }
            Act::Submit => {
                let job = self.world.submitted;
                self.world.submitted += 1;
                let interpreted = setup.jobs[usize::from(job)] == Content::Interpreted;
                let class = if interpreted { Class::Interpreted } else { Class::Immediate };
                self.host(HostInput::Submit { ticket: job.into(), word: setup.word(job), class });
            }
            Act::Send(fate) => {
                let line = setup.tick * u32::from(setup.line);
                self.host(HostInput::Sent { line });
                if let HostLink::Awaiting(sent) = self.world.host.link {
                    let job = sent.batch.first as u8;
                    self.world.down.push(Transmission { job, passed: 0, fate });
                }
            }
            Act::Timeout => self.host(HostInput::Timeout),
            Act::Resume => self.host(HostInput::Resume),
            Act::Judge(verdict) => self.judge(verdict),
            Act::Finish(result) => {
                self.world.executing = 0;
                self.controller(ControllerInput::Executed(result));
                self.read();
            }
            Act::Reply(fate) => {
                // The line has been silent while an instruction was executed.
                if self.world.controller.expires(Duration::ZERO) {
                    self.silence();
                }
                let due = self.world.controller.transmit(Duration::ZERO, &setup.controller);
                self.controller(ControllerInput::Sent);
                let late = if let Fate::Late { ticks } = fate { ticks } else { 0 };
                if let (Some(answer), true) = (due, fate != Fate::Lost) {
                    let corrupt = fate == Fate::Corrupt;
                    self.world.up.push(Reply { answer, ticks: setup.answer + late, corrupt });
                }
            }
            Act::Noise => {
                self.controller(ControllerInput::Bytes);
                self.world.held = Held::Noise;
                self.read();
            }
            Act::Crash { cut } => {
                if cut {
                    self.world.down.clear();
                }
                // What was not sent, the next process sends.
                self.world.submitted -= u8::from(self.world.host.next.is_some());
                let submitted = usize::from(self.world.submitted);
                for job in self.world.jobs.iter_mut().take(submitted) {
                    job.reported.get_or_insert(Reported::Abandoned);
                }
                self.world.connected = false;
                self.world.host = HostMachine::NEW;
            }
            Act::Disconnect => {
                self.world.connected = false;
                self.host(HostInput::Disconnected);
            }
            Act::Restart => {
                self.world.controller = ControllerMachine::NEW;
                (self.world.held, self.world.executing) = (Held::Nothing, 0);
                self.world.found.clear();
                self.controller(ControllerInput::Connected);
            }
        }
    }

    fn host(&mut self, input: HostInput) {
        let action = drive(&mut self.world.host, input, &self.setup.host, &mut self.edges);
        match action {
            Ok(Action::Report(batch, outcome)) => {
                let reported = match outcome {
                    Outcome::Done { unanswered, .. } => Reported::Done { unanswered: unanswered > 0 },
                    Outcome::Refused(_) => Reported::Refused,
                    Outcome::Unknown(_) => Reported::Unknown,
                };
                let job = &mut self.world.jobs[batch.first as usize];
                job.again |= job.reported.is_some();
                job.reported = Some(reported);
            }
            Ok(Action::Nothing | Action::Sent(_) | Action::Unasked { .. }) => {}
            Err(_) => self.world.unexpected = true,
        }
    }

    fn controller(&mut self, input: ControllerInput) {
        let action = drive(&mut self.world.controller, input, &self.setup.controller, &mut self.edges);
        self.world.unexpected |= action.is_err();
    }

    fn tick(&mut self) {
        age(&mut self.world.host, self.setup.tick);
        age(&mut self.world.controller, self.setup.tick);
        self.world.executing = self.world.executing.saturating_sub(1);
        self.carry_down();
        self.carry_up();
        if self.world.controller.expires(Duration::ZERO) {
            self.silence();
        }
    }

    /// One tick's bytes of the first frame on the line.
    fn carry_down(&mut self) {
        let setup = self.setup;
        let Some(transmission) = self.world.down.first_mut() else { return };
        let Transmission { job, passed, fate } = *transmission;
        match &mut transmission.fate {
            Fate::Paused { after, ticks } if *after == passed && *ticks > 0 => {
                *ticks -= 1;
                if *ticks == 0 {
                    transmission.fate = Fate::Good;
                }
                return;
            }
            _ => transmission.passed += 1,
        }
        let (first, last) = (passed == 0, passed + 1 == setup.line);
        if last {
            self.world.down.remove(0);
            if setup.reports_transmitted && self.world.down.is_empty() && self.world.connected {
                self.host(HostInput::Transmitted);
            }
        }
        match fate {
            Fate::Lost => return,
            Fate::Cut { after } if passed >= after => return,
            _ => {}
        }
        self.controller(ControllerInput::Bytes);
        if first && fate != Fate::Headless {
            self.head(job);
        } else {
            self.world.held = match self.world.held {
                Held::Nothing | Held::Headless | Held::Noise => Held::Headless,
                // The rest of another frame, or a frame without its head, after a half that was kept.
                Held::Part(part) if part != job || fate == Fate::Headless => Held::Spoilt,
                held => held,
            };
        }
        if last && self.world.held != Held::Headless {
            let whole = self.world.held == Held::Part(job) && fate != Fate::Corrupt;
            let found =
                if whole { Found::Frame(job) } else { Found::Corrupt(Refusal::BadChecksum, MANY, true) };
            self.world.found.push(found);
            self.world.held = Held::Nothing;
        }
        self.read();
    }

    /// A head comes.
    fn head(&mut self, job: u8) {
        let corrupt = match self.world.held {
            Held::Part(_) | Held::Spoilt if self.setup.reader.swallows => {
                self.world.held = Held::Spoilt;
                return;
            }
            Held::Part(_) | Held::Spoilt => Some((MANY, true)),
            Held::Headless => Some((MANY, false)),
            Held::Noise => Some((FEW, false)),
            Held::Nothing => None,
        };
        let corrupt = corrupt.map(|(bytes, begun)| Found::Corrupt(Refusal::BadFrame, bytes, begun));
        self.world.found.extend(corrupt);
        self.world.held = Held::Part(job);
    }

    /// The controller reads what was found, up to a good frame: that is judged by an act of its own.
    fn read(&mut self) {
        while !self.world.is_executing() {
            let trusts = self.world.controller.trusts(&self.setup.controller);
            let input = match self.world.found.first().copied() {
                Some(Found::Corrupt(refusal, bytes, begun)) => {
                    ControllerInput::Corrupt { refusal, bytes, begun }
                }
                Some(Found::Frame(_)) if !trusts => ControllerInput::Untrusted,
                Some(Found::Frame(_)) | None => break,
            };
            self.world.found.remove(0);
            self.controller(input);
        }
        let frame_waits = !self.world.found.is_empty() && !self.world.is_executing();
        if matches!(self.world.controller.line, Receiving::Bytes(_)) && !frame_waits {
            let partial = self.world.held != Held::Nothing || !self.world.found.is_empty();
            self.controller(ControllerInput::Read { partial });
        }
    }

    fn silence(&mut self) {
        let setup = self.setup;
        let corrupt = match self.world.held {
            Held::Nothing => None,
            Held::Noise => Some((FEW, false)),
            Held::Part(_) | Held::Spoilt => Some((MANY, true)),
            Held::Headless => setup.reader.answers_headless.then_some((MANY, false)),
        };
        let corrupt = corrupt.map(|(bytes, begun)| Found::Corrupt(Refusal::BadFrame, bytes, begun));
        self.world.found.extend(corrupt);
        if !(setup.reader.keeps && matches!(self.world.held, Held::Part(_) | Held::Spoilt)) {
            self.world.held = Held::Nothing;
        }
        self.read();
        if self.world.controller.expires(Duration::ZERO) {
            self.controller(ControllerInput::Timeout);
        }
    }

    fn carry_up(&mut self) {
        let blocked = self.world.is_blocked(self.setup);
        let Some(reply) = self.world.up.first_mut() else { return };
        if blocked && reply.ticks <= 1 {
            return;
        }
        reply.ticks -= 1;
        if reply.ticks > 0 {
            return;
        }
        let Reply { answer, corrupt, .. } = self.world.up.remove(0);
        if !self.world.connected {
            return;
        }
        if let (Answer::Echo(word), false) = (answer, corrupt) {
            self.note_echo(word);
        }
        self.host(match answer {
            _ if corrupt => HostInput::Corrupt,
            Answer::Echo(word) => HostInput::Answer { word, refusal: None },
            Answer::Error(refusal) => {
                let word = self.setup.host.words.errors().code(refusal);
                HostInput::Answer { word, refusal: Some(refusal) }
            }
        });
    }

    fn note_echo(&mut self, word: u16) {
        let batch = match self.world.host.link {
            HostLink::Awaiting(sent) => sent.batch,
            HostLink::Resending { batch, .. } | HostLink::AwaitingRest { batch, .. } => batch,
            HostLink::Disconnected { .. } | HostLink::Idle { .. } | HostLink::Held { .. } => return,
        };
        self.world.jobs[batch.first as usize].echoed |= batch.word == word;
    }

    fn judge(&mut self, verdict: Result<(), Refusal>) {
        let setup = self.setup;
        let Found::Frame(job) = self.world.found.remove(0) else { return };
        let (content, word) = (setup.jobs[usize::from(job)], setup.word(job));
        let record = &mut self.world.jobs[usize::from(job)];
        let input = match (verdict, content) {
            (Err(refusal), _) => ControllerInput::Refused(refusal),
            (Ok(()), Content::Mixed) if setup.reader.refuses_mixed => {
                ControllerInput::Refused(Refusal::BadBatch)
            }
            (Ok(()), Content::Interpreted) => {
                record.executed = (record.executed + 1).min(2);
                ControllerInput::Queued { word }
            }
            (Ok(()), Content::Immediate | Content::Mixed) => {
                record.executed = (record.executed + 1).min(2);
                record.swallowed |= content == Content::Mixed;
                self.world.executing = setup.execution;
                ControllerInput::Immediate { word }
            }
        };
        self.controller(input);
        self.read();
    }
}
