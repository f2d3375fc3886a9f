//! Both machines, the connection between them, the device's owner and its axes, and the caller.

use core::time::Duration;

use mmacell_proto::central::machine::{self as central, CentralLink, CentralMachine};
use mmacell_proto::device::machine::{self as device, Axes, DeviceMachine};
use mmacell_proto::{
    CentralEvent, Closing, Command, DecodeError, DeviceEvent, ErrorCode, Miss, Mode, Order, Progress, Reply,
    Unfinished,
};
use robot_session::end::Machine as _;

use super::world::{
    ARRIVED, Act, BETWEEN, DONE, EXPECTED, HOME, IN_FAULT, Job, NO_BREAK, NO_TARGET, NOT_DONE, NOT_MISSED,
    ONCE, ONE_MOTION, OUTCOME, Outcome, Pose, SERVO_OFF, STRAY, Setup, TICK, Truth, UNKNOWN, World, target,
};
use crate::model::{Edge, Edges, System, age, drive};

/// What the caller requests besides the next motion.
const REQUESTS: [Command<Pose>; 6] = [
    Command::Status,
    Command::Servo { on: true },
    Command::Servo { on: false },
    Command::Stop,
    Command::Reset,
    Command::Close,
];

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
            again: None,
            truth: UNKNOWN,
            owner: [None; 2],
            at: HOME,
            going: None,
            young: false,
            jobs: [Job { executed: 0, outcome: None }; 2],
            next: 0,
            pending: None,
            target: None,
            foreign: false,
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
            for command in REQUESTS {
                add(true, Act::Request(command));
            }
        }
        let sending = matches!(world.central.link, CentralLink::Sending { .. });
        add(sending, Act::Transmit);
        add(sending || matches!(world.central.link, CentralLink::Awaiting { .. }), Act::Abort);
        // Of an owner who answers late, two orders are enough.
        let reads = world.down.is_some() && world.device.reads() && world.owner[1].is_none();
        add(reads, Act::Deliver);
        add(world.owner[0].is_some(), Act::Accept);
        add(world.pending_reply().is_some() && world.up.is_none(), Act::Reply);
        add(world.up.is_some(), Act::Return);
        add(world.central.deadline() == Some(Duration::ZERO), Act::Due);
        add(world.going.is_some(), Act::Arrive);
        // Nothing is waited for that could happen at once, but time may pass before anything.
        add(world.ages(), Act::Tick);
        if world.faults > 0 {
            add(world.going.is_some(), Act::Stall);
            let status = matches!(world.pending_reply(), Some(Reply::Status(status)) if status.moving);
            add(status && world.young && world.up.is_none(), Act::LateReply);
            for error in [ErrorCode::Generic, ErrorCode::Other(77)] {
                add(world.owner[0].is_some(), Act::Refuse(error));
            }
            add(!matches!(world.device.axes, Axes::Fault { .. }), Act::Fail);
            let status = matches!(world.pending_reply(), Some(Reply::Status(status)) if status.servo && !status.moving);
            add(status && world.up.is_none(), Act::ServoOffReply);
            add(world.pending_reply().is_some() && world.up.is_none() && !world.cut, Act::RepeatReply);
            add(world.up.is_some(), Act::Garble);
            add(reads, Act::Misread);
            add(open && !world.cut, Act::Usurp);
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
                world.hang_up(false);
                (world.target, world.truth) = (None, UNKNOWN);
                self.device(&mut world, device::Input::Connected, edges);
                self.central(&mut world, central::Input::Connected, edges);
            }
            Act::Move => {
                let pose = target(world.next);
                world.pending = Some(world.next);
                world.next += 1;
                let command = Command::Move { mode: Mode::Absolute, pose };
                self.central(&mut world, central::Input::Request(command), edges);
            }
            Act::Request(command) => self.central(&mut world, central::Input::Request(command), edges),
            Act::Abort => self.central(&mut world, central::Input::Abort, edges),
            Act::Transmit => self.ask(&mut world, edges),
            Act::Deliver => {
                if let Some(command) = world.down.take() {
                    if command == Command::Status {
                        let servo = world.device.axes.servo();
                        world.truth = Truth { at: world.at, moves: world.going.is_some(), servo };
                    }
                    self.device(&mut world, device::Input::Command(command), edges);
                }
            }
            Act::Accept => self.accept(&mut world, edges),
            Act::Reply => {
                // What has once reported that it moves does not report that it has not begun.
                world.young &= !matches!(world.pending_reply(), Some(Reply::Status(status)) if status.moving);
                self.answer(&mut world, edges);
            }
            Act::Return => {
                if let Some(reply) = world.up.take() {
                    self.receive(&mut world, reply, edges);
                }
                world.up = world.again.take();
                if let (Some(reply), false) = (world.up, self.late_repeats) {
                    world.up = None;
                    let ends = !matches!(world.central.link, CentralLink::Ended);
                    self.receive(&mut world, reply, edges);
                    if ends && world.central.link != CentralLink::Ended {
                        world.wrong = Some(STRAY);
                    }
                }
            }
            Act::Due => self.central(&mut world, central::Input::Timeout, edges),
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
                self.answer(&mut world, edges);
                if let Some(Reply::Status(status)) = &mut world.up {
                    status.moving = false;
                }
            }
            Act::Refuse(error) => {
                world.faults -= 1;
                if let Some(order) = world.take_order() {
                    let _ =
                        drive(&mut world.device, device::Input::Refuse(order, error), &self.device, edges);
                }
            }
            Act::Fail => {
                world.faults -= 1;
                world.going = None;
                self.device(&mut world, device::Input::Failed(ErrorCode::Servo1), edges);
            }
            Act::ServoOffReply => {
                world.faults -= 1;
                world.truth.servo = false;
                self.answer(&mut world, edges);
                if let Some(Reply::Status(status)) = &mut world.up {
                    status.servo = false;
                }
            }
            Act::RepeatReply => {
                world.faults -= 1;
                world.foreign = true;
                self.answer(&mut world, edges);
                world.again = world.up;
            }
            Act::Garble => {
                world.faults -= 1;
                world.foreign = true;
                world.hang_up(world.cut);
                self.central(&mut world, central::Input::Corrupt(DecodeError::Incomplete), edges);
            }
            Act::Misread => {
                world.faults -= 1;
                world.down = None;
                self.device(&mut world, device::Input::Corrupt(DecodeError::Incomplete), edges);
            }
            Act::Usurp => {
                world.faults -= 1;
                world.hang_up(true);
                self.device(&mut world, device::Input::Connected, edges);
            }
            Act::Cut => {
                world.faults -= 1;
                world.hang_up(true);
            }
            Act::Break => {
                world.faults -= 1;
                world.hang_up(world.cut);
                self.device(&mut world, device::Input::Disconnected, edges);
                self.central(&mut world, central::Input::Disconnected, edges);
            }
            Act::RestartDevice => {
                world.faults -= 1;
                world.hang_up(true);
                (world.owner, world.going, world.young) = ([None; 2], None, false);
                world.device = DeviceMachine { pose: Some(world.at), ..DeviceMachine::NEW };
            }
            Act::RestartCentral => {
                world.faults -= 1;
                world.hang_up(true);
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
    fn central(&self, world: &mut World, input: central::Input<Pose>, edges: &mut Edges<'_>) {
        let action = drive(&mut world.central, input, &self.central, edges);
        match action {
            Ok(
                central::Action::Nothing
                | central::Action::Connected { before: None }
                | central::Action::Sent,
            ) => {}
            Ok(central::Action::Report(event) | central::Action::Connected { before: Some(event) }) => {
                self.report(world, event);
            }
            Err(_) => world.wrong = Some(EXPECTED),
        }
    }

    fn ask(&self, world: &mut World, edges: &mut Edges<'_>) {
        let command = world.central.transmit(Duration::ZERO, &self.central);
        self.central(world, central::Input::Sent, edges);
        world.down = command.filter(|_| !world.cut);
    }

    fn answer(&self, world: &mut World, edges: &mut Edges<'_>) {
        let reply = world.pending_reply();
        self.device(world, device::Input::Sent, edges);
        world.up = reply.filter(|_| !world.cut);
    }

    fn device(&self, world: &mut World, input: device::Input<Pose>, edges: &mut Edges<'_>) {
        match drive(&mut world.device, input, &self.device, edges) {
            Ok(device::Action::Report(DeviceEvent::Asked { order })) => {
                if let Some(free) = world.owner.iter_mut().find(|slot| slot.is_none()) {
                    *free = Some(order);
                }
            }
            Ok(_) => {}
            Err(_) => world.wrong = Some(EXPECTED),
        }
    }

    /// The owner accepts the order that it was asked first, also if nobody waits for it any more, and carries it out.
    fn accept(&self, world: &mut World, edges: &mut Edges<'_>) {
        let Some(order) = world.take_order() else { return };
        let (in_fault, off) =
            (matches!(world.device.axes, Axes::Fault { .. }), world.device.axes == Axes::Off);
        // It is not pending any more, or not possible.
        let Ok(device::Action::Nothing) =
            drive(&mut world.device, device::Input::Accept(order), &self.device, edges)
        else {
            return;
        };
        match order {
            Order::Move { target: pose } => {
                if in_fault {
                    world.wrong = Some(IN_FAULT);
                }
                if off {
                    world.wrong = Some(SERVO_OFF);
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
            Order::Stop | Order::Servo { on: false } if world.going.take().is_some() => {
                self.rest(world, BETWEEN, edges);
            }
            _ => {}
        }
    }

    fn rest(&self, world: &mut World, at: Pose, edges: &mut Edges<'_>) {
        world.at = at;
        self.device(world, device::Input::Pose(Some(at)), edges);
        self.device(world, device::Input::Arrived, edges);
    }

    fn receive(&self, world: &mut World, reply: Reply<Pose>, edges: &mut Edges<'_>) {
        let truth = core::mem::replace(&mut world.truth, UNKNOWN);
        match drive(&mut world.central, central::Input::Reply(reply), &self.central, edges) {
            Ok(central::Action::Report(CentralEvent::Status { motion, .. })) => match motion {
                // After a reset only the servo motors can be judged.
                Progress::Missed(Miss::ServoOff) if world.target.is_none() && world.resets() => {}
                Progress::Arrived | Progress::Missed(_) if world.target.is_none() => {
                    world.wrong = Some(NO_TARGET);
                }
                Progress::Arrived if truth.moves || !truth.servo || world.target != Some(truth.at) => {
                    world.wrong = Some(ARRIVED);
                }
                Progress::Missed(_) if truth.moves => world.wrong = Some(NOT_MISSED),
                _ => {}
            },
            Ok(central::Action::Report(event)) => {
                if let CentralEvent::Done { command } = event {
                    match command {
                        Command::Move { pose, .. } => world.target = Some(pose),
                        Command::Stop | Command::Reset | Command::Servo { on: false } => world.target = None,
                        _ => {}
                    }
                }
                self.report(world, event);
            }
            Ok(_) => {}
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
                if !world.foreign {
                    world.wrong = Some(NO_BREAK);
                }
                return;
            }
            _ => return,
        };
        if world.pending.is_none() {
            world.wrong = Some(OUTCOME);
        }
        world.conclude(outcome);
        if let CentralEvent::Closed { reason: Closing::Mismatch | Closing::Malformed(_), .. } = event
            && !world.foreign
        {
            world.wrong = Some(NO_BREAK);
        }
    }
}
