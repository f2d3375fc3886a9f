//! Both machines, the line between them, and the people at either end.

use core::time::Duration;

use robot_session::Unexpected;
use val2_alter::machine::{
    Answer, ControllerActions, ControllerInput, ControllerMachine, ControllerPhase, Course, Draft, Handling,
    HostActions, HostInput, HostMachine, HostPhase, Outgoing, Progress, Taken, Turn, Wanted,
};
use val2_alter::{
    AXES, ControllerConfig, ErrorCode, Exception, ExceptionOutcome, HostConfig, Mode, MotionPhase, Policy,
    StartCode,
};

use crate::model::{Edge, Edges, Machine, System, age, drive};

pub(super) const ONCE: &str = "an exception is executed once at most";
pub(super) const DONE: &str = "what is reported done was executed";
pub(super) const NOT_DONE: &str = "what is reported not done was not executed";
pub(super) const OUTCOME: &str = "one outcome for each exception";
pub(super) const WORDS: &str = "a word that is left out is zero in the controller";
pub(super) const STALE: &str = "the arm follows only a fresh target";
pub(super) const ZEROS: &str = "a stop is done when the arm was sent to rest";
pub(super) const SILENT: &str = "after a stop no message is answered";
pub(super) const UNASKED: &str = "the arm does not move in an interruption";
pub(super) const INVENTED_MODE: &str = "only the configured mode runs";
pub(super) const EXPECTED: &str = "no input is unexpected";

/// A quarter of a cycle.
const TICK: Duration = Duration::from_millis(7);
/// What the caller's target is good for, in ticks.
const FRESH: u8 = 2;
const GRIP: Exception = Exception::CloseGripper;

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
    /// The controller's program names another mode.
    pub other_mode: bool,
    /// The controller keeps the words that come in an interruption.
    pub takes_all: bool,
}

impl Alter {
    /// No faults.
    pub fn new(mode: Mode) -> Self {
        let host = HostConfig {
            mode,
            subroutine: true,
            // One word fits, another one only when it is in use already.
            reserve: Duration::from_millis(11),
            target_timeout: TICK * u32::from(FRESH),
            gap: None,
            ..HostConfig::default()
        };
        let controller =
            ControllerConfig { mode, subroutine: true, gap: None, ..ControllerConfig::default() };
        Self { faults: 0, jobs: 0, host, controller, other_mode: false, takes_all: true }
    }
}

/// Everything that decides what happens next.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct World {
    host: HostMachine,
    controller: ControllerMachine,
    /// What the controller has sent, and for how many ticks it waits.
    down: Option<(Message, u8)>,
    up: Option<(Reply, u8)>,
    faults: u8,
    jobs: Vec<Job>,
    /// Ticks since the caller set a target, up to the most that count.
    target_age: u8,
    stop: Stop,
    /// The words that a controller holds which keeps what is left out.
    held: u8,
    broken: Option<&'static str>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Message {
    Start,
    Motion(MotionPhase, ErrorCode),
    End,
    Corrupt,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Reply {
    Start(StartCode),
    Values { select: u8, moving: u8, job: Option<u8> },
    Corrupt,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
struct Job {
    executed: u8,
    outcome: Option<ExceptionOutcome>,
    abandoned: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Stop {
    NotYet,
    Asked,
    Reported,
    Over,
}

/// What the line makes of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Fate {
    /// It arrives.
    Good,
    /// It does not.
    Lost,
    /// It is no message any more.
    Corrupt,
    /// It arrives a tick later, or is read later.
    Late,
}

/// One thing that happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Act {
    /// The controller sends what is due.
    Send(Fate),
    /// The host reads it.
    Read,
    /// The host answers with values of which these are not zero.
    Answer(Fate, u8),
    /// The answer arrives.
    Arrive,
    /// Bytes that nobody sent arrive at the controller.
    Noise,
    /// The caller has an exception.
    Ask,
    /// The caller sets a target.
    Target,
    /// The caller stops.
    Stop,
    /// The caller accepts ALTER again.
    Accept,
    /// The subroutine returns.
    Return,
    /// The program executes its ALTER instruction.
    Start,
    /// The program ends ALTER.
    Finish,
    /// The host loses its memory.
    RestartHost,
    /// The controller loses its memory.
    RestartController,
    /// The port of the host is lost and is back.
    Reopen,
    /// A quarter of a cycle.
    Tick,
}

impl Machine for HostMachine {
    const END: &'static str = "host";
    type Input = HostInput;
    type Action = HostActions;
    type Config = HostConfig;

    fn on(
        &mut self,
        now: Duration,
        input: HostInput,
        config: &HostConfig,
    ) -> Result<HostActions, Unexpected> {
        self.on(now, input, config)
    }

    fn each_time(&mut self, f: impl FnMut(&mut Duration)) {
        self.each_time(f);
    }

    fn name(&self) -> &'static str {
        self.name()
    }

    fn input_name(input: &HostInput) -> &'static str {
        input.name()
    }

    fn action_name(actions: &HostActions) -> String {
        let send = actions.send.map(|answer| match answer {
            Answer::Start(code) => format!("{code:?}").to_lowercase(),
            Answer::Reply { exception: Exception::None, .. } => "reply".into(),
            Answer::Reply { .. } => "reply with the exception".into(),
        });
        let outcome = actions.outcome.map(|(_, outcome)| match outcome {
            ExceptionOutcome::Done => "exception done".into(),
            ExceptionOutcome::NotDone => "exception not done".into(),
            ExceptionOutcome::Unknown(_) => "exception unknown".into(),
        });
        let flags = [
            (actions.missed, "missed"),
            (actions.rejected.is_some(), "rejected"),
            (actions.stale, "target stale"),
            (actions.stopped, "stopped"),
            (actions.ended, "ended"),
            (actions.lost.is_some(), "lost"),
        ];
        let flags = flags.into_iter().filter(|(set, _)| *set).map(|(_, name)| name.into());
        flags.chain(outcome).chain(send).collect::<Vec<String>>().join(", ")
    }
}

impl Machine for ControllerMachine {
    const END: &'static str = "controller";
    type Input = ControllerInput;
    type Action = ControllerActions;
    type Config = ControllerConfig;

    fn on(
        &mut self,
        now: Duration,
        input: ControllerInput,
        config: &ControllerConfig,
    ) -> Result<ControllerActions, Unexpected> {
        self.on(now, input, config)
    }

    fn each_time(&mut self, f: impl FnMut(&mut Duration)) {
        self.each_time(f);
    }

    fn name(&self) -> &'static str {
        self.name()
    }

    fn input_name(input: &ControllerInput) -> &'static str {
        input.name()
    }

    fn action_name(actions: &ControllerActions) -> String {
        let send = actions.send.map(|message| match message {
            Outgoing::Start(_) => "start message",
            Outgoing::Motion(MotionPhase::Running, _) => "standard message",
            Outgoing::Motion(MotionPhase::Interrupted, _) => "standard message, interrupted",
            Outgoing::End(_) => "end message",
        });
        let start = actions.start.map(|outcome| format!("{outcome:?}").to_lowercase());
        let flags = [
            (actions.taken == Some(Taken::Moves), "move"),
            (actions.bad_reply.is_some(), "bad reply"),
            (actions.exception.is_some(), "exception"),
            (actions.stray, "stray"),
            (actions.ended.is_some(), "ended"),
        ];
        let flags = flags.into_iter().filter(|(set, _)| *set).map(|(_, name)| name.to_string());
        flags.chain(start).chain(send.map(Into::into)).collect::<Vec<_>>().join(", ")
    }
}

impl World {
    fn fail(&mut self, property: &'static str) {
        self.broken.get_or_insert(property);
    }

    fn host(&mut self, system: &Alter, input: HostInput, edges: &mut Edges<'_>) -> HostActions {
        let Ok(actions) = drive(&mut self.host, input, &system.host, edges) else {
            self.fail(EXPECTED);
            return HostActions::default();
        };
        if let Some((_, outcome)) = actions.outcome {
            match self.jobs.last_mut() {
                Some(job) if job.outcome.is_none() => job.outcome = Some(outcome),
                _ => self.fail(OUTCOME),
            }
        }
        if actions.stopped {
            if self.held != 0 {
                self.fail(ZEROS);
            }
            self.stop = Stop::Reported;
        } else if self.stop == Stop::Asked && (actions.ended || actions.lost.is_some()) {
            self.stop = Stop::Over;
        }
        actions
    }

    fn controller(
        &mut self,
        system: &Alter,
        input: ControllerInput,
        edges: &mut Edges<'_>,
    ) -> ControllerActions {
        let Ok(actions) = drive(&mut self.controller, input, &system.controller, edges) else {
            self.fail(EXPECTED);
            return ControllerActions::default();
        };
        if actions.restart {
            self.held = 0;
        }
        if actions.close_window {
            self.controller(system, ControllerInput::WindowClosed, edges);
        }
        actions
    }

    fn interrupted(&self) -> bool {
        matches!(&self.controller.phase, ControllerPhase::On(alter) if matches!(alter.progress, Progress::Interrupted { .. }))
    }

    fn in_window(&self) -> bool {
        matches!(&self.controller.phase, ControllerPhase::On(alter) if alter.turn != Turn::Controller)
    }

    fn arrive(&mut self, system: &Alter, edges: &mut Edges<'_>) {
        let Some((reply, _)) = self.up.take() else { return };
        let interrupted = self.interrupted();
        let (input, values) = match reply {
            Reply::Start(code) => (ControllerInput::StartReply(code), None),
            Reply::Corrupt => (ControllerInput::Corrupt(ErrorCode::Checksum), None),
            Reply::Values { select, moving, job } => {
                let exception = if job.is_some() { GRIP } else { Exception::None };
                (ControllerInput::Reply { exception, has_room: true }, Some((select, moving, job)))
            }
        };
        let actions = self.controller(system, input, edges);
        let Some((select, moving, job)) = values else { return };
        match actions.taken {
            Some(Taken::Moves) => {
                self.held = self.held & !select | moving;
                if self.held != moving {
                    self.fail(WORDS);
                }
                if interrupted {
                    self.fail(UNASKED);
                }
            }
            Some(Taken::Rests) if system.takes_all => self.held = self.held & !select | moving,
            Some(Taken::Rests) | None => {}
        }
        if let (Some(Handling::Subroutine(_)), Some(job)) = (actions.exception, job)
            && let Some(job) = self.jobs.get_mut(usize::from(job))
        {
            job.executed = (job.executed + 1).min(2);
        }
    }

    fn open_job(&self) -> bool {
        self.jobs.last().is_some_and(|job| job.outcome.is_none() && !job.abandoned)
    }

    fn may_ask(&self, system: &Alter) -> bool {
        self.jobs.len() < system.jobs.into() && !self.open_job() && self.host.name() == "running"
    }
}

impl System for Alter {
    type State = World;
    type Act = Act;

    fn init(&self) -> World {
        let mut host = HostMachine::new(Policy::Accept, true);
        let mut controller = ControllerMachine::NEW;
        let _ = host.on(Duration::ZERO, HostInput::Connected, &self.host);
        let _ = controller.on(Duration::ZERO, ControllerInput::Connected, &self.controller);
        World {
            host,
            controller,
            down: None,
            up: None,
            faults: self.faults,
            jobs: Vec::new(),
            target_age: FRESH,
            stop: Stop::NotYet,
            held: 0,
            broken: None,
        }
    }

    fn acts(&self, world: &World, acts: &mut Vec<Act>) {
        let faulty = world.faults > 0;
        let fates = |good: Act, each: fn(Fate) -> Act, acts: &mut Vec<Act>| {
            acts.push(good);
            if faulty {
                acts.extend([Fate::Lost, Fate::Corrupt, Fate::Late].map(each));
            }
        };
        if faulty {
            acts.extend([Act::RestartHost, Act::RestartController, Act::Reopen, Act::Finish]);
            if world.in_window() {
                acts.push(Act::Noise);
            }
        }
        if world.controller.due(Duration::ZERO).is_some() {
            return fates(Act::Send(Fate::Good), Act::Send, acts);
        }
        if let Some((_, 0)) = world.down {
            return acts.push(Act::Read);
        }
        if let Some((_, 0)) = world.up {
            return acts.push(Act::Arrive);
        }
        if world.may_ask(self) {
            acts.push(Act::Ask);
        }
        if let Some(wanted) = world.host.wanted(&self.host) {
            // An offset stays where it is; which one it is has been forgotten.
            let moves = matches!(wanted, Wanted::Reply { course: Course::Target | Course::Hold, .. });
            fates(Act::Answer(Fate::Good, 0), |fate| Act::Answer(fate, 0), acts);
            if moves {
                for moving in 1..=3 {
                    acts.push(Act::Answer(Fate::Good, moving));
                    if faulty {
                        acts.push(Act::Answer(Fate::Corrupt, moving));
                    }
                }
            }
            return;
        }
        if world.target_age > 0 && world.host.name() == "running" {
            acts.push(Act::Target);
        }
        match world.stop {
            Stop::NotYet if matches!(world.host.name(), "running" | "interrupted") => acts.push(Act::Stop),
            Stop::Reported | Stop::Over if world.host.policy == Policy::Ignore => acts.push(Act::Accept),
            Stop::NotYet | Stop::Asked | Stop::Reported | Stop::Over => {}
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
        let faulty = match act {
            Act::Send(fate) | Act::Answer(fate, _) => fate != Fate::Good,
            Act::Noise | Act::RestartHost | Act::RestartController | Act::Reopen | Act::Finish => true,
            _ => false,
        };
        world.faults -= u8::from(faulty);
        match act {
            Act::Send(fate) => {
                let actions = world.controller(self, ControllerInput::Transmit { len: 12 }, edges);
                let message = match actions.send {
                    Some(Outgoing::Start(_)) => Message::Start,
                    Some(Outgoing::Motion(phase, error)) => Message::Motion(phase, error),
                    Some(Outgoing::End(_)) | None => Message::End,
                };
                world.down = carry(message, Message::Corrupt, fate);
            }
            Act::Read => {
                let input = match world.down.take() {
                    Some((Message::Start, _)) => HostInput::Start { is_expected: !self.other_mode, len: 12 },
                    Some((Message::Motion(phase, error), _)) => HostInput::Motion { phase, error, len: 12 },
                    Some((Message::End, _)) => HostInput::End,
                    Some((Message::Corrupt, _)) | None => HostInput::CorruptFrame,
                };
                world.host(self, input, edges);
            }
            Act::Answer(fate, moving) => {
                let wanted = world.host.wanted(&self.host);
                if matches!(wanted, Some(Wanted::Reply { course: Course::Target, .. }))
                    && world.target_age >= FRESH
                {
                    world.fail(STALE);
                }
                let draft = Draft { bare: 8, words: [4; AXES], moving, at_rest: moving == 0, has_room: true };
                let actions = world.host(self, HostInput::Transmit(draft), edges);
                let reply = match actions.send {
                    Some(Answer::Start(code)) => Reply::Start(code),
                    Some(Answer::Reply { select, held, exception }) => {
                        if world.stop == Stop::Reported {
                            world.fail(SILENT);
                        }
                        let job = (exception != Exception::None).then(|| world.jobs.len() as u8 - 1);
                        Reply::Values { select, moving: moving & !held, job }
                    }
                    None => return world,
                };
                world.up = carry(reply, Reply::Corrupt, fate);
            }
            Act::Arrive => world.arrive(self, edges),
            Act::Noise => _ = world.controller(self, ControllerInput::Corrupt(ErrorCode::Mark), edges),
            Act::Ask => {
                world.jobs.push(Job::default());
                let input = HostInput::Exception { exception: GRIP, has_room: true };
                if world.host(self, input, edges).refused.is_some() {
                    world.fail(EXPECTED);
                }
            }
            Act::Target => {
                world.host(self, HostInput::Target, edges);
                world.target_age = 0;
            }
            Act::Stop => {
                world.stop = Stop::Asked;
                world.host(self, HostInput::Stop, edges);
            }
            Act::Accept => _ = world.host(self, HostInput::Policy(Policy::Accept), edges),
            Act::Return => _ = world.controller(self, ControllerInput::Return, edges),
            Act::Start => _ = world.controller(self, ControllerInput::Start { has_room: true }, edges),
            Act::Finish => _ = world.controller(self, ControllerInput::Finish, edges),
            Act::RestartHost => {
                world.host = HostMachine::new(Policy::Accept, true);
                if let Some(job) = world.jobs.last_mut() {
                    job.abandoned |= job.outcome.is_none();
                }
                if world.stop == Stop::Asked {
                    world.stop = Stop::Over;
                }
                world.host(self, HostInput::Connected, edges);
            }
            Act::RestartController => {
                world.controller = ControllerMachine::NEW;
                world.held = 0;
                world.controller(self, ControllerInput::Connected, edges);
            }
            Act::Reopen => {
                world.host(self, HostInput::Disconnected, edges);
                world.host(self, HostInput::Connected, edges);
            }
            Act::Tick => {
                age(&mut world.host, TICK);
                age(&mut world.controller, TICK);
                world.target_age = (world.target_age + 1).min(FRESH);
                for wait in world
                    .down
                    .iter_mut()
                    .map(|(_, wait)| wait)
                    .chain(world.up.iter_mut().map(|(_, wait)| wait))
                {
                    *wait = wait.saturating_sub(1);
                }
                world.controller(self, ControllerInput::Timeout, edges);
                world.host(self, HostInput::Timeout, edges);
            }
        }
        if world.stop == Stop::Reported && world.host.policy == Policy::Accept {
            world.stop = Stop::Over;
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
        if self.other_mode && matches!(world.host.phase, HostPhase::Active(_)) {
            broken.push(INVENTED_MODE);
        }
    }

    fn benign(&self, world: &World) -> Option<Act> {
        let mut acts = Vec::new();
        self.acts(&World { faults: 0, ..world.clone() }, &mut acts);
        let last = |act: &&Act| !matches!(act, Act::Target | Act::Stop | Act::Tick | Act::Answer(_, 1..));
        acts.iter().find(last).or(acts.last()).copied()
    }

    fn is_over(&self, world: &World) -> bool {
        self.other_mode
            || world.jobs.len() == usize::from(self.jobs)
                && !world.open_job()
                && world.stop != Stop::Asked
                && matches!(world.host.name(), "running" | "silent" | "idle")
    }

    fn ticks(&self, act: Act) -> u32 {
        (act == Act::Tick).into()
    }
}

/// What is in flight after a fate.
fn carry<T>(message: T, corrupt: T, fate: Fate) -> Option<(T, u8)> {
    match fate {
        Fate::Good => Some((message, 0)),
        Fate::Lost => None,
        Fate::Corrupt => Some((corrupt, 0)),
        Fate::Late => Some((message, 1)),
    }
}
