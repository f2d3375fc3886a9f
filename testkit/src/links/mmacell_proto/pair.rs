//! Both machines, the connection between them, the device's owner and its axes, and the caller.

use core::time::Duration;

use mmacell_proto::central::machine::{CentralAction, CentralInput, CentralLink, CentralMachine};
use mmacell_proto::device::machine::{Axes, DeviceAction, DeviceInput, DeviceMachine};
use mmacell_proto::{
    CentralConfig, CentralEvent, Closing, Command, DeviceConfig, DeviceEvent, ErrorCode, Mode, Order,
    PlatformPose, Progress, Reply, Unfinished,
};
use robot_session::Unexpected;

use crate::model::{Edge, Edges, Machine, System, age, drive};

pub(super) const TICK: Duration = Duration::from_millis(50);
const HOME: PlatformPose = PlatformPose::ORIGIN;
/// Where a motion ends that something stops.
const BETWEEN: PlatformPose = PlatformPose::from_units([5_000, 0]);

pub(super) const DONE: &str = "done: executed";
pub(super) const NOT_DONE: &str = "not done: not executed";
const ONCE: &str = "executed at most once";
const OUTCOME: &str = "one outcome for each request";
pub(super) const ARRIVED: &str = "arrived: at rest at the target, servo motors on";
pub(super) const NOT_MISSED: &str = "missed: not under way";
pub(super) const NO_TARGET: &str = "no target: neither arrived nor missed";
pub(super) const IN_FAULT: &str = "nothing moves in a fault";
pub(super) const ONE_MOTION: &str = "one motion at a time";
const EXPECTED: &str = "no unexpected input";
const NO_BREAK: &str = "no connection ends without a fault";

type Pose = PlatformPose;

const UNKNOWN: Truth = Truth { at: HOME, moves: false, servo: false };

/// The bounds of the system.
#[derive(Debug, Clone, Copy)]
pub struct Setup {
    /// The central controller's end.
    pub central: CentralConfig,
    /// The device's end.
    pub device: DeviceConfig,
    /// Motions that the caller commands, each to another pose.
    pub jobs: u8,
    /// Faults of any kind.
    pub faults: u8,
}

/// Everything that decides what happens next.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct World {
    /// The central controller's end.
    pub central: CentralMachine<Pose>,
    /// The device's end.
    pub device: DeviceMachine<Pose>,
    /// Nothing arrives any more, and no end knows.
    pub cut: bool,
    /// A command on its way.
    pub down: Option<Command<Pose>>,
    /// A reply on its way.
    pub up: Option<Reply<Pose>>,
    /// What was true when the status was asked for last.
    pub truth: Truth,
    /// Orders that the owner has not answered.
    pub owner: [Option<Order<Pose>>; 2],
    /// Where the axes are.
    pub at: Pose,
    /// Where they go.
    pub going: Option<Pose>,
    /// The motion began in this tick: a device may still report that it is at rest.
    pub young: bool,
    /// Each job: how often it was executed, and its outcome.
    pub jobs: [Job; 2],
    /// The next job.
    pub next: u8,
    /// The job that has no outcome yet.
    pub pending: Option<u8>,
    /// The target of the motion that the device has agreed to on this connection, as the caller knows it.
    pub target: Option<Pose>,
    /// Faults that may still come.
    pub faults: u8,
    /// What must not be, and was.
    pub wrong: Option<&'static str>,
}

/// What is true of the axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Truth {
    at: Pose,
    moves: bool,
    servo: bool,
}

/// What is known of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Job {
    executed: u8,
    outcome: Option<Outcome>,
}

/// What its sender was notified of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Outcome {
    /// Executed.
    Done,
    /// Not executed.
    NotDone,
    /// Nobody can tell.
    Unknown,
}

/// One thing that happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Act {
    /// The caller makes a connection; the device may not know that the one before is gone.
    Connect,
    /// The caller requests the next motion.
    Move,
    /// The caller requests something else.
    Request(Command<Pose>),
    /// The caller aborts.
    Abort,
    /// The command is sent.
    Transmit,
    /// It arrives.
    Deliver,
    /// The owner accepts its first order.
    Accept,
    /// The reply is sent.
    Reply,
    /// The reply arrives.
    Return,
    /// The central controller's time is handled.
    Due,
    /// 50 ms pass.
    Tick,
    /// The axes reach their target.
    Arrive,
    /// Fault: something stops them on their way, and the device does not notice.
    Stall,
    /// Fault: the reply is that of a device that begins a motion late: it still reports that it is at rest.
    LateReply,
    /// Fault: the owner refuses its first order.
    Refuse,
    /// Fault: the device fails.
    Fail,
    /// Fault: the servo motors are switched off at the device.
    ServoOff,
    /// Fault: nothing arrives any more, and nobody knows.
    Cut,
    /// Fault: the connection breaks, and both ends know.
    Break,
    /// Fault: the device restarts and loses its memory; nobody knows.
    RestartDevice,
    /// Fault: the central controller restarts and loses its memory; the device does not know.
    RestartCentral,
}

impl Machine for CentralMachine<Pose> {
    const END: &'static str = "central";
    type Input = CentralInput<Pose>;
    type Action = CentralAction<Pose>;
    type Config = CentralConfig;

    fn on(
        &mut self,
        now: Duration,
        input: Self::Input,
        config: &CentralConfig,
    ) -> Result<Self::Action, Unexpected> {
        CentralMachine::on(self, now, input, config)
    }

    fn each_time(&mut self, f: impl FnMut(&mut Duration)) {
        CentralMachine::each_time(self, f);
    }

    fn name(&self) -> &'static str {
        CentralMachine::name(self)
    }

    fn input_name(input: &Self::Input) -> &'static str {
        input.name()
    }
}

impl Machine for DeviceMachine<Pose> {
    const END: &'static str = "device";
    type Input = DeviceInput<Pose>;
    type Action = DeviceAction<Pose>;
    type Config = DeviceConfig;

    fn on(
        &mut self,
        _: Duration,
        input: Self::Input,
        config: &DeviceConfig,
    ) -> Result<Self::Action, Unexpected> {
        DeviceMachine::on(self, input, config)
    }

    fn each_time(&mut self, _: impl FnMut(&mut Duration)) {}

    fn name(&self) -> &'static str {
        DeviceMachine::name(self)
    }

    fn input_name(input: &Self::Input) -> &'static str {
        input.name()
    }
}

impl System for Setup {
    type State = World;
    type Act = Act;

    fn init(&self) -> World {
        World {
            central: CentralMachine::NEW,
            device: DeviceMachine { pose: Some(HOME), ..DeviceMachine::NEW },
            cut: false,
            down: None,
            up: None,
            truth: UNKNOWN,
            owner: [None; 2],
            at: HOME,
            going: None,
            young: false,
            jobs: [Job { executed: 0, outcome: None }; 2],
            next: 0,
            pending: None,
            target: None,
            faults: self.faults,
            wrong: None,
        }
    }

    fn acts(&self, world: &World, acts: &mut Vec<Act>) {
        let mut add = |allowed: bool, act| {
            if allowed {
                acts.push(act)
            }
        };
        let idle = world.central.link == CentralLink::Idle;
        let open = !matches!(world.central.link, CentralLink::Down | CentralLink::Ended);
        add(!open, Act::Connect);
        if idle && !self.is_over(world) {
            add(world.next < self.jobs, Act::Move);
            for command in [Command::Status, Command::Servo { on: true }, Command::Stop, Command::Reset] {
                add(true, Act::Request(command));
            }
        }
        let sending = matches!(world.central.link, CentralLink::Sending { .. });
        add(sending, Act::Transmit);
        add(sending || matches!(world.central.link, CentralLink::Awaiting { .. }), Act::Abort);
        add(world.down.is_some() && world.device.reads(), Act::Deliver);
        add(world.owner[0].is_some(), Act::Accept);
        add(world.device.pending().is_some() && world.up.is_none(), Act::Reply);
        add(world.up.is_some(), Act::Return);
        add(world.central.deadline() == Some(Duration::ZERO), Act::Due);
        add(world.going.is_some(), Act::Arrive);
        // Nothing is waited for that could happen at once, but time may pass before anything.
        add(world.ages(), Act::Tick);
        if world.faults > 0 {
            add(world.going.is_some(), Act::Stall);
            let status = matches!(world.device.pending(), Some(Reply::Status(status)) if status.moving);
            add(status && world.young && world.up.is_none(), Act::LateReply);
            add(world.owner[0].is_some(), Act::Refuse);
            add(!matches!(world.device.axes, Axes::Fault { .. }), Act::Fail);
            add(world.device.axes == Axes::Still, Act::ServoOff);
            add(open && !world.cut, Act::Cut);
            add(open, Act::Break);
            add(true, Act::RestartDevice);
            add(open, Act::RestartCentral);
        }
    }

    fn step(&self, state: &World, act: Act, edges: Option<&mut Vec<Edge>>) -> World {
        let mut world = state.clone();
        let edges = &mut { edges };
        match act {
            Act::Connect => {
                (world.cut, world.down, world.up) = (false, None, None);
                (world.target, world.truth) = (None, UNKNOWN);
                self.device(&mut world, DeviceInput::Connected, edges);
                self.central(&mut world, CentralInput::Connected, edges);
            }
            Act::Move => {
                let pose = target(world.next);
                world.pending = Some(world.next);
                world.next += 1;
                let command = Command::Move { mode: Mode::Absolute, pose };
                self.central(&mut world, CentralInput::Request(command), edges);
            }
            Act::Request(command) => self.central(&mut world, CentralInput::Request(command), edges),
            Act::Abort => self.central(&mut world, CentralInput::Abort, edges),
            Act::Transmit => self.central(&mut world, CentralInput::Transmit, edges),
            Act::Deliver => {
                if let Some(command) = world.down.take() {
                    if command == Command::Status {
                        let servo = world.device.axes.servo();
                        world.truth = Truth { at: world.at, moves: world.going.is_some(), servo };
                    }
                    self.device(&mut world, DeviceInput::Command(command), edges);
                }
            }
            Act::Accept => self.accept(&mut world, edges),
            Act::Reply => {
                // What has once reported that it moves does not report that it has not begun.
                world.young &=
                    !matches!(world.device.pending(), Some(Reply::Status(status)) if status.moving);
                self.device(&mut world, DeviceInput::Transmit, edges);
            }
            Act::Return => {
                if let Some(reply) = world.up.take() {
                    self.receive(&mut world, reply, edges);
                }
            }
            Act::Due => self.central(&mut world, CentralInput::Due, edges),
            Act::Tick => {
                age(&mut world.central, TICK);
                world.young = false;
            }
            Act::Arrive => {
                if let Some(at) = world.going.take() {
                    self.rest(&mut world, at, edges);
                }
            }
            Act::Stall => {
                world.faults -= 1;
                world.going = None;
                self.rest(&mut world, BETWEEN, edges);
            }
            Act::LateReply => {
                world.faults -= 1;
                self.device(&mut world, DeviceInput::Transmit, edges);
                if let Some(Reply::Status(status)) = &mut world.up {
                    status.moving = false;
                }
            }
            Act::Refuse => {
                world.faults -= 1;
                if let Some(order) = world.take_order() {
                    let error = ErrorCode::Other(77);
                    let _ = drive(&mut world.device, DeviceInput::Refuse(order, error), &self.device, edges);
                }
            }
            Act::Fail => {
                world.faults -= 1;
                world.going = None;
                self.device(&mut world, DeviceInput::Failed(ErrorCode::Servo1), edges);
            }
            Act::ServoOff => {
                world.faults -= 1;
                world.device.axes = Axes::Off;
            }
            Act::Cut => {
                world.faults -= 1;
                (world.cut, world.down, world.up) = (true, None, None);
            }
            Act::Break => {
                world.faults -= 1;
                (world.down, world.up) = (None, None);
                self.device(&mut world, DeviceInput::Disconnected, edges);
                self.central(&mut world, CentralInput::Disconnected, edges);
            }
            Act::RestartDevice => {
                world.faults -= 1;
                (world.cut, world.down, world.up) = (true, None, None);
                (world.owner, world.going, world.young) = ([None; 2], None, false);
                world.device = DeviceMachine { pose: Some(world.at), ..DeviceMachine::NEW };
            }
            Act::RestartCentral => {
                world.faults -= 1;
                (world.cut, world.down, world.up) = (true, None, None);
                world.central = CentralMachine::NEW;
                // Nobody is left who knows.
                world.conclude(Outcome::Unknown);
            }
        }
        world
    }

    fn broken(&self, world: &World, broken: &mut Vec<&'static str>) {
        broken.extend(world.wrong);
        for job in world.jobs {
            if job.executed > 1 {
                broken.push(ONCE);
            }
            match job.outcome {
                Some(Outcome::Done) if job.executed == 0 => broken.push(DONE),
                Some(Outcome::NotDone) if job.executed > 0 => broken.push(NOT_DONE),
                _ => {}
            }
        }
    }

    fn benign(&self, world: &World) -> Option<Act> {
        let mut acts = Vec::new();
        self.acts(&World { faults: 0, ..world.clone() }, &mut acts);
        let request = match world.device.axes {
            _ if world.cut => Act::Request(Command::Status),
            Axes::Off => Act::Request(Command::Servo { on: true }),
            Axes::Fault { .. } => Act::Request(Command::Reset),
            Axes::Moving | Axes::Stopping => Act::Request(Command::Status),
            Axes::Still => Act::Move,
        };
        // What can happen happens; then the axes arrive; then time passes; only then something new is requested.
        let order =
            [Act::Connect, Act::Due, Act::Transmit, Act::Deliver, Act::Accept, Act::Reply, Act::Return];
        let order = order.into_iter().chain([Act::Arrive]);
        if let Some(act) = order.into_iter().find(|act| acts.contains(act)) {
            return Some(act);
        }
        let idle = world.central.link == CentralLink::Idle;
        let next = if idle { request } else { Act::Tick };
        acts.contains(&next).then_some(next)
    }

    fn is_over(&self, world: &World) -> bool {
        world.next == self.jobs && world.pending.is_none() && world.central.link == CentralLink::Idle
    }

    fn ticks(&self, act: Act) -> u32 {
        u32::from(act == Act::Tick)
    }
}

impl Setup {
    fn central(&self, world: &mut World, input: CentralInput<Pose>, edges: &mut Edges<'_>) {
        let action = drive(&mut world.central, input, &self.central, edges);
        match action {
            Ok(CentralAction::None) => {}
            Ok(CentralAction::Send(command)) => world.down = (!world.cut).then_some(command),
            Ok(CentralAction::Report(event)) => self.report(world, event),
            Err(_) => world.wrong = Some(EXPECTED),
        }
    }

    fn device(&self, world: &mut World, input: DeviceInput<Pose>, edges: &mut Edges<'_>) {
        match drive(&mut world.device, input, &self.device, edges) {
            Ok(DeviceAction::None) => {}
            Ok(DeviceAction::Send(reply)) => world.up = (!world.cut).then_some(reply),
            Ok(DeviceAction::Leave) => world.up = (!world.cut).then_some(Reply::Ok),
            Ok(DeviceAction::Report(DeviceEvent::Asked { order })) => {
                if let Some(free) = world.owner.iter_mut().find(|slot| slot.is_none()) {
                    *free = Some(order);
                }
            }
            Ok(DeviceAction::Report(_)) => {}
            Err(_) => world.wrong = Some(EXPECTED),
        }
    }

    /// The owner accepts the order that it was asked first, also if nobody waits for it any more, and carries it out.
    fn accept(&self, world: &mut World, edges: &mut Edges<'_>) {
        let Some(order) = world.take_order() else { return };
        let in_fault = matches!(world.device.axes, Axes::Fault { .. });
        // It is not pending any more, or not possible.
        let Ok(DeviceAction::None) =
            drive(&mut world.device, DeviceInput::Accept(order), &self.device, edges)
        else {
            return;
        };
        match order {
            Order::Move { target: pose } => {
                if in_fault {
                    world.wrong = Some(IN_FAULT);
                }
                if world.going.is_some() {
                    world.wrong = Some(ONE_MOTION);
                }
                if let Some(job) = (0..).zip(&mut world.jobs).find(|(n, _)| target(*n) == pose) {
                    job.1.executed = (job.1.executed + 1).min(2);
                }
                (world.going, world.young) = (Some(pose), true);
            }
            Order::Home => (world.going, world.young) = (Some(HOME), true),
            Order::Stop if world.going.take().is_some() => self.rest(world, BETWEEN, edges),
            _ => {}
        }
    }

    fn rest(&self, world: &mut World, at: Pose, edges: &mut Edges<'_>) {
        world.at = at;
        self.device(world, DeviceInput::Pose(Some(at)), edges);
        self.device(world, DeviceInput::Arrived, edges);
    }

    fn receive(&self, world: &mut World, reply: Reply<Pose>, edges: &mut Edges<'_>) {
        let truth = core::mem::replace(&mut world.truth, UNKNOWN);
        match drive(&mut world.central, CentralInput::Reply(reply), &self.central, edges) {
            Ok(CentralAction::Report(CentralEvent::Status { motion, .. })) => match motion {
                // After a reset only the servo motors can be judged.
                Progress::Missed(mmacell_proto::Miss::ServoOff)
                    if world.target.is_none() && world.resets() => {}
                Progress::Arrived | Progress::Missed(_) if world.target.is_none() => {
                    world.wrong = Some(NO_TARGET);
                }
                Progress::Arrived if truth.moves || !truth.servo || world.target != Some(truth.at) => {
                    world.wrong = Some(ARRIVED);
                }
                Progress::Missed(_) if truth.moves => world.wrong = Some(NOT_MISSED),
                _ => {}
            },
            Ok(CentralAction::Report(event)) => {
                if let CentralEvent::Done { command } = event {
                    match command {
                        Command::Move { pose, .. } => world.target = Some(pose),
                        Command::Stop | Command::Reset => world.target = None,
                        _ => {}
                    }
                }
                self.report(world, event);
            }
            Ok(CentralAction::None | CentralAction::Send(_)) => {}
            Err(_) => world.wrong = Some(EXPECTED),
        }
    }

    fn report(&self, world: &mut World, event: CentralEvent<Pose>) {
        let outcome = match event {
            CentralEvent::Done { command: Command::Move { .. } } => Outcome::Done,
            CentralEvent::Refused { command: Command::Move { .. }, .. }
            | CentralEvent::Aborted { command: Command::Move { .. } }
            | CentralEvent::Closed { unfinished: Unfinished::NotSent(Command::Move { .. }), .. } => {
                Outcome::NotDone
            }
            CentralEvent::Closed { unfinished: Unfinished::Unknown(Command::Move { .. }), .. } => {
                Outcome::Unknown
            }
            CentralEvent::Closed { reason: Closing::Mismatch | Closing::Malformed(_), .. } => {
                world.wrong = Some(NO_BREAK);
                return;
            }
            _ => return,
        };
        if world.pending.is_none() {
            world.wrong = Some(OUTCOME);
        }
        world.conclude(outcome);
        if let CentralEvent::Closed { reason: Closing::Mismatch | Closing::Malformed(_), .. } = event {
            world.wrong = Some(NO_BREAK);
        }
    }
}

impl World {
    fn take_order(&mut self) -> Option<Order<Pose>> {
        let [first, second] = &mut self.owner;
        core::mem::replace(first, second.take())
    }

    fn conclude(&mut self, outcome: Outcome) {
        if let Some(job) = self.pending.take().and_then(|job| self.jobs.get_mut(usize::from(job))) {
            job.outcome = Some(outcome);
        }
    }

    /// Whether a tick changes anything.
    fn ages(&self) -> bool {
        let mut ages = self.young;
        self.central.clone().each_time(|time| ages |= !time.is_zero() && *time != Duration::MAX);
        ages
    }

    /// Whether the last motion was a reset.
    fn resets(&self) -> bool {
        use mmacell_proto::central::machine::{Motion, Target};
        let (Motion::Starting { target, .. } | Motion::Moving { target } | Motion::Rest { target, .. }) =
            self.central.motion
        else {
            return false;
        };
        target == Target::Unknown
    }
}

/// Where a job leads.
fn target(job: u8) -> Pose {
    PlatformPose::from_units([100 * (i32::from(job) + 1), 0])
}
