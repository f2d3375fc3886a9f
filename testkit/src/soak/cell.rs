//! A whole cell: the pick-and-place task over three TCP connections, each with its faults. A job is a part.

use core::time::Duration;

use mmacell_proto::controller::{self, Controller};
use mmacell_proto::device::{Device, Event as Order};
use mmacell_proto::task::{self, Event, Output, Step, Task};
use mmacell_proto::{Command, Dialect, ErrorCode, NoPose, PlatformPose, Pose, RobotPose, VACUUM};

use super::{Check, Ledger, Log, Row, Tally, Told, Wire};
use crate::link::{Delivery, End, Faults};
use crate::rng::Rng;

pub(super) const TASK: Row =
    Row { link: "mmacell-proto", transport: "task", job: "parts", one_in: None, session };

const MS: Duration = Duration::from_millis(1);
const LIMIT: Duration = Duration::from_secs(600);

/// A pose part of the way between two others.
trait Axes: Pose {
    fn between(from: Self, to: Self, part: f64) -> Self;
}

fn mixed<const N: usize>(from: [i32; N], to: [i32; N], part: f64) -> [i32; N] {
    core::array::from_fn(|i| from[i] + (f64::from(to[i] - from[i]) * part) as i32)
}

impl Axes for RobotPose {
    fn between(from: Self, to: Self, part: f64) -> Self {
        Self::from_units(mixed(from.units(), to.units(), part))
    }
}

impl Axes for PlatformPose {
    fn between(from: Self, to: Self, part: f64) -> Self {
        Self::from_units(mixed(from.units(), to.units(), part))
    }
}

/// Where a part lies, and where it belongs.
fn pick(part: usize) -> RobotPose {
    RobotPose::from_units([1000 + part as i32, 2000, -500, part as i32])
}

fn place(part: usize) -> RobotPose {
    RobotPose::from_units([-3000 - part as i32, 100, -500, 0])
}

/// One device, its connection, and the controller's end of it. The conditioning system has no axes that anybody asks for.
struct Station<P, D> {
    name: task::Device,
    wire: Wire,
    controller: Controller<P>,
    device: Device<D>,
    inbox: Vec<u8>,
    gone: [bool; 2],
    motion: Option<Motion<D>>,
}

struct Motion<D> {
    from: D,
    to: D,
    begin: Duration,
    end: Duration,
}

impl<P: Pose, D: Axes> Station<P, D> {
    fn new(
        name: task::Device,
        home: D,
        seed: u64,
        faults: Faults,
        names: [&'static str; 2],
        log: Log,
    ) -> Self {
        Self {
            name,
            wire: Wire::new(seed, faults, names, true, log),
            controller: Controller::new(controller::Config::DEFAULT),
            device: Device::new(home, Dialect::STRICT),
            inbox: Vec::new(),
            gone: [false; 2],
            motion: None,
        }
    }

    fn pose(&self, now: Duration) -> D {
        match &self.motion {
            None => self.device.status().pose,
            Some(motion) => {
                let whole = (motion.end - motion.begin).as_secs_f64().max(1e-9);
                let part = now.saturating_sub(motion.begin).as_secs_f64() / whole;
                D::between(motion.from, motion.to, part.min(1.0))
            }
        }
    }

    fn go(&mut self, now: Duration, to: D, rng: &mut Rng) {
        let from = self.pose(now);
        self.motion = Some(Motion { from, to, begin: now, end: now + MS * (20 + rng.below(300) as u32) });
    }

    fn stand(&mut self, now: Duration) {
        let pose = self.pose(now);
        self.motion = None;
        self.device.set_pose(pose);
    }

    /// Both ends, once; what the task has to hear of it.
    fn step(&mut self, now: Duration, home: D, rng: &mut Rng, heard: &mut Vec<Event>) {
        let mut buffer = [0; 64];
        while let Some(len) = self.controller.poll_transmit(now, &mut buffer) {
            self.wire.send(End::A, now, &buffer[..len]);
        }
        self.controller.handle_timeout(now);
        if self.motion.as_ref().is_some_and(|motion| motion.end <= now) {
            self.stand(now);
            self.device.arrived();
        }
        if rng.chance(0.0003) {
            self.stand(now);
            self.device.fail(ErrorCode::Servo2);
        }
        while let Some(delivery) = self.wire.receive(End::B, now) {
            match delivery {
                Delivery::Bytes(bytes) => self.inbox.extend(bytes),
                Delivery::Closed => self.gone[1] = true,
            }
        }
        while !self.inbox.is_empty() {
            let taken = self.device.handle_input(now, &self.inbox);
            self.inbox.drain(..taken);
            let event = self.device.poll_event();
            match event {
                Some(Order::Move { target }) => self.go(now, target, rng),
                Some(Order::Home) => self.go(now, home, rng),
                Some(Order::Stop) => {
                    self.stand(now);
                    self.device.arrived();
                }
                Some(Order::Servo { on: false }) => self.stand(now),
                _ => {}
            }
            let pose = self.pose(now);
            self.device.set_pose(pose);
            while let Some(len) = self.device.poll_transmit(now, &mut buffer) {
                self.wire.send(End::B, now, &buffer[..len]);
            }
            if taken == 0 && event.is_none() {
                break;
            }
        }
        while let Some(delivery) = self.wire.receive(End::A, now) {
            match delivery {
                Delivery::Bytes(bytes) => self.controller.handle_input(now, &bytes),
                Delivery::Closed => {
                    self.gone[0] = true;
                    self.controller.handle_disconnect();
                }
            }
        }
        while let Some(event) = self.controller.poll_event() {
            if let controller::Event::Closed { .. } = event
                && self.wire.is_connected()
            {
                self.wire.disconnect(now);
            }
            heard.extend(Event::from_controller(self.name, &event));
        }
        if self.gone == [true; 2] {
            self.wire.reconnect(now);
            self.inbox.clear();
            self.device.connect();
            self.controller = Controller::new(controller::Config::DEFAULT);
            self.gone = [false; 2];
            heard.push(Event::Ready(self.name));
        }
    }
}

struct Cell {
    now: Duration,
    log: Log,
    ledger: Ledger,
    task: Task,
    robot: Station<RobotPose, RobotPose>,
    platform: Station<PlatformPose, PlatformPose>,
    conditioning: Station<NoPose, PlatformPose>,
    /// What the cameras will say, and when.
    picture: Option<(Duration, i32)>,
    /// The part that the camera has shown and whose fate is not known yet.
    open: Option<usize>,
    vacuum: bool,
    /// The part that lies there to be picked, and whether it hangs on the gripper.
    part: Option<usize>,
    held: bool,
}

fn session(seed: u64, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let faults = Faults {
        disconnect: [0.0, 0.005, 0.02][rng.below(3)],
        delay: 0.05,
        max_delay: [50 * MS, 1200 * MS][rng.below(2)],
        pause: 20 * MS,
        ..Faults::TCP
    };
    let config = task::Config {
        camera_1: Some(RobotPose::from_units([0, 5000, 0, 0])),
        camera_2: rng.chance(0.5).then_some(RobotPose::from_units([0, 0, 5000, 0])),
        ..task::Config::DEFAULT
    };
    let seeds = [seed, seed ^ 1 << 62, seed ^ 2 << 62];
    let names = [["central", "robot"], ["central", "platform"], ["central", "conditioning"]];
    let (robot, platform) = (config.robot_home, config.platform_home);
    let mut cell = Cell {
        now: Duration::ZERO,
        log,
        ledger: Ledger::default(),
        task: Task::new(config),
        robot: Station::new(task::Device::Robot, robot, seeds[0], faults, names[0], log),
        platform: Station::new(task::Device::Platform, platform, seeds[1], faults, names[1], log),
        conditioning: Station::new(task::Device::Conditioning, platform, seeds[2], faults, names[2], log),
        picture: None,
        open: None,
        vacuum: false,
        part: None,
        held: false,
    };
    for device in [task::Device::Robot, task::Device::Platform, task::Device::Conditioning] {
        cell.task.handle_event(cell.now, Event::Ready(device));
    }
    let parts = 1 + rng.below(4);
    while cell.task.step() != Step::Finished {
        assert!(cell.now < LIMIT, "the task stands still in {:?}", cell.task.step());
        cell.step(&config, parts, &mut rng);
    }
    let mut tally = Tally::default();
    for wire in [&cell.robot.wire, &cell.platform.wire, &cell.conditioning.wire] {
        wire.settle(cell.now, &mut tally, 0, |_, _| Check::Nothing);
    }
    cell.ledger.settle(cell.now, log, &mut tally, |_| false);
    tally
}

impl Cell {
    fn step(&mut self, config: &task::Config, parts: usize, rng: &mut Rng) {
        let (now, mut heard) = (self.now, Vec::new());
        self.robot.step(now, config.robot_home, rng, &mut heard);
        self.platform.step(now, config.platform_home, rng, &mut heard);
        self.conditioning.step(now, config.platform_home, rng, &mut heard);
        heard.extend(self.look(rng));
        heard.extend(self.gripper(rng));
        for event in heard {
            self.tell(event);
        }
        self.task.handle_timeout(now);
        self.obey(parts);
        let wires = [&self.platform.wire, &self.conditioning.wire].map(Wire::next_delivery);
        let replies = [
            self.robot.controller.poll_timeout(),
            self.platform.controller.poll_timeout(),
            self.conditioning.controller.poll_timeout(),
        ];
        let arrivals = [
            self.robot.motion.as_ref().map(|motion| motion.end),
            self.platform.motion.as_ref().map(|motion| motion.end),
            self.conditioning.motion.as_ref().map(|motion| motion.end),
        ];
        let own = [self.task.poll_timeout(), self.picture.map(|(at, _)| at)];
        let times = wires.into_iter().chain(replies).chain(arrivals).chain(own);
        // The vacuum is looked at often enough to stop on the way.
        self.now = self.robot.wire.next(now, times).min(now + 10 * MS);
    }

    fn tell(&mut self, event: Event) {
        if !matches!(event, Event::Status { .. }) {
            self.log.say(self.now, format_args!("  task hears {event:?}"));
        }
        self.task.handle_event(self.now, event);
    }

    /// The picture that was asked for.
    fn look(&mut self, rng: &mut Rng) -> Option<Event> {
        let (_, camera) = self.picture.take_if(|(at, _)| *at <= self.now)?;
        if rng.chance(0.05) {
            return Some(Event::NotFound);
        }
        if camera == 2 {
            return self.open.map(|part| Event::SlotFound { place: place(part) });
        }
        let part = self.ledger.send(self.robot.wire.mark());
        (self.open, self.part, self.held) = (Some(part), Some(part), false);
        self.log.say(self.now, format_args!("job {part}: a part"));
        let platform = PlatformPose::from_units([part as i32, 10]);
        Some(Event::PartFound { platform, pick: pick(part) })
    }

    /// What vacuum and part do; the switch, when it changes.
    fn gripper(&mut self, rng: &mut Rng) -> Option<Event> {
        let (before, pose) = (self.held, self.robot.pose(self.now));
        match self.part {
            Some(part) if self.held && !self.vacuum => {
                self.log.say(self.now, format_args!("  part {part} is put down at {:?}", pose.units()));
                if pose == place(part) {
                    self.ledger.execute(part);
                }
                (self.part, self.held) = (None, false);
            }
            // It falls on the way.
            Some(part) if self.held && pose != place(part) && rng.chance(0.002) => {
                self.log.say(self.now, format_args!("  part {part} falls"));
                (self.part, self.held) = (None, false);
            }
            Some(part) if self.vacuum && pose == pick(part) => self.held |= rng.chance(0.8),
            _ => {}
        }
        (before != self.held).then_some(Event::Switch { high: self.held })
    }

    fn obey(&mut self, parts: usize) {
        while let Some(output) = self.task.poll_output(self.now) {
            if !matches!(output, Output::Robot(Command::Status) | Output::Platform(Command::Status)) {
                self.log.say(self.now, format_args!("  task: {output:?}"));
            }
            match output {
                Output::Robot(command) => self.robot.controller.send(command).unwrap(),
                Output::Platform(command) => self.platform.controller.send(command).unwrap(),
                Output::Conditioning(command) => self.conditioning.controller.send(command).unwrap(),
                Output::Acquire { camera } => self.picture = Some((self.now + 30 * MS, camera)),
                Output::Grip { gripper, open } => {
                    if gripper == VACUUM {
                        self.vacuum = open;
                    }
                    self.tell(Event::Done(task::Device::Gripper));
                }
                Output::Entered(step) => self.entered(step, parts),
                _ => {}
            }
        }
    }

    /// What the operator knows when the task enters a step, and wants then.
    fn entered(&mut self, step: Step, parts: usize) {
        let told = match step {
            Step::Placed => Told::Done,
            Step::GiveUp | Step::NothingFound => Told::NotDone,
            Step::Faulted => Told::Unknown,
            _ => return,
        };
        if let Some(part) = self.open.take() {
            self.ledger.tell(part, told, self.robot.wire.mark());
        }
        let enough = self.ledger.len() >= parts;
        match step {
            Step::Placed | Step::NothingFound => self.tell(if enough { Event::Finish } else { Event::Next }),
            Step::Faulted => self.tell(if enough { Event::Finish } else { Event::Recover }),
            _ => {}
        }
    }
}
