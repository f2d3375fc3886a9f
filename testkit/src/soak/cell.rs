//! A whole cell: the pick-and-place task over three TCP connections, each with its faults. A job is a part.

use core::time::Duration;

use mmacell_proto::robot_session::Session as _;
use mmacell_proto::robot_session::end::End as _;
use mmacell_proto::{
    Central, CentralConfig, CentralEvent, Command, Device, DeviceConfig, DeviceEvent, ErrorCode, NoPose,
    Order, PlatformPose, Pose, RobotPose, VACUUM,
};
use mmacell_task::{self as task, Event, Output, Step, Task, TaskConfig};

use super::line::Line;
use super::{Check, Ledger, Log, ReportedOutcome, Row, Tally, Wire};
use crate::link::{End, Faults};
use robot_session::contract::Rng;

pub(super) const TASK: Row =
    Row { link: "mmacell-proto", transport: "task", job: "parts", one_in: None, session };

const MS: Duration = Duration::from_millis(1);
const S: Duration = Duration::from_secs(1);
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

/// Returns the pose at which a part is picked, and the pose at which it is placed.
fn pick(part: usize) -> RobotPose {
    RobotPose::from_units([1000 + part as i32, 2000, -500, part as i32])
}

fn place(part: usize) -> RobotPose {
    RobotPose::from_units([-3000 - part as i32, 100, -500, 0])
}

/// A device, its connection, and the central controller's end of it. The conditioning system has axes, but nothing
/// polls them.
struct Station<P: Pose, D: Pose> {
    name: task::Device,
    wire: Wire,
    central: Central<P>,
    device: Device<D>,
    /// No byte arrives, and no end is notified of it.
    cut: bool,
    connects_at: Option<Duration>,
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
            central: Central::new(CentralConfig::DEFAULT).unwrap(),
            device: at(home),
            cut: false,
            connects_at: Some(Duration::ZERO),
            motion: None,
        }
    }

    fn pose(&self, now: Duration) -> D {
        match &self.motion {
            None => self.device.machine().pose.unwrap(),
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

    fn request(&mut self, command: Command<P>) {
        self.central.request(command).unwrap();
    }

    /// Runs both ends once; returns the task's events.
    fn step(&mut self, now: Duration, home: D, bad: f64, rng: &mut Rng, events: &mut Vec<Event>) {
        self.fail(now, bad, rng);
        if self.connects_at.take_if(|at| *at <= now).is_some() {
            self.wire.reconnect(now);
            self.cut = false;
            // The device may not know that the connection before is gone.
            self.device.handle_connected(now);
            self.central.handle_connected(now);
        }
        if self.motion.as_ref().is_some_and(|motion| motion.end <= now) {
            self.stand(now);
            self.device.arrived();
        }
        loop {
            let (mut line, mut asked) = (Line { wire: &mut self.wire, cut: self.cut }, None);
            line.turn(End::B, &mut self.device, now, |_, event| {
                if let DeviceEvent::Asked { order } = event {
                    asked = Some(order);
                }
            });
            let Some(order) = asked else { break };
            if rng.chance(0.002 * bad) {
                let _ = self.device.refuse(order, ErrorCode::Other(77));
            } else if self.device.accept(order).is_ok() {
                self.carry_out(now, order, home, bad, rng);
            }
            let pose = self.pose(now);
            self.device.set_pose(pose);
        }
        let pose = self.pose(now);
        self.device.set_pose(pose);
        let (mut line, mut closed) = (Line { wire: &mut self.wire, cut: self.cut }, false);
        line.turn(End::A, &mut self.central, now, |_, event| {
            closed |= matches!(event, CentralEvent::Closed { .. });
            if event == CentralEvent::Connected {
                events.push(Event::Ready(self.name));
            }
            events.extend(Event::from_central(self.name, &event));
        });
        if closed {
            if self.wire.is_connected() && rng.chance(0.5) {
                self.wire.disconnect(now);
            }
            self.connects_at = Some(now + rng.log_uniform(MS, 100 * MS));
        }
    }

    /// Injects the faults beside those of the transport.
    fn fail(&mut self, now: Duration, bad: f64, rng: &mut Rng) {
        if rng.chance(0.0003 * bad) {
            self.stand(now);
            self.device.fail(ErrorCode::Servo2);
        }
        if rng.chance(0.0002 * bad) {
            // The device restarts, and no end is notified.
            let pose = self.pose(now);
            (self.motion, self.device, self.cut) = (None, at(pose), true);
        }
        if rng.chance(0.0002 * bad) {
            self.cut = true;
        }
    }

    fn carry_out(&mut self, now: Duration, order: Order<D>, home: D, bad: f64, rng: &mut Rng) {
        match order {
            Order::Move { target } => {
                self.go(now, target, rng);
                // Something is in its way, and it does not notice.
                if let Some(motion) = self.motion.as_mut().filter(|_| rng.chance(0.01 * bad)) {
                    motion.to = D::between(motion.from, motion.to, 0.5);
                }
            }
            Order::Home => self.go(now, home, rng),
            Order::Stop => {
                self.stand(now);
                self.device.arrived();
            }
            Order::Servo { on: false } => self.stand(now),
            _ => {}
        }
    }
}

/// Returns a device that has just been switched on.
fn at<D: Pose>(pose: D) -> Device<D> {
    let mut device = Device::new(DeviceConfig::DEFAULT).unwrap();
    device.set_pose(pose);
    device
}

struct Cell {
    now: Duration,
    log: Log,
    ledger: Ledger,
    task: Task,
    robot: Station<RobotPose, RobotPose>,
    platform: Station<PlatformPose, PlatformPose>,
    conditioning: Station<NoPose, PlatformPose>,
    /// The next picture of the cameras, and its time.
    picture: Option<(Duration, i32)>,
    /// The part that the camera has shown and whose fate is not known yet.
    open: Option<usize>,
    vacuum: bool,
    /// The part that is there to be picked, and whether it hangs on the gripper.
    part: Option<usize>,
    held: bool,
    /// Whether it is placed so badly that this pick fails.
    slips: bool,
    /// Whether the vacuum switch is high whatever the vacuum does, until the operator looks after a fault.
    stuck_high: bool,
    switch: bool,
    /// The rate of faults: 0 in the last minute.
    bad: f64,
    /// A part was placed when nothing went wrong any more.
    is_done: bool,
}

fn session(seed: u64, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let faults = Faults {
        disconnect: [0.0, 0.005, 0.02][rng.below(3)],
        delay: 0.05,
        max_delay: [50 * MS, 1200 * MS][rng.below(2)],
        pause: 20 * MS,
        stall: 0.002,
        ..Faults::TCP
    };
    let config = TaskConfig {
        camera_1: Some(RobotPose::from_units([0, 5000, 0, 0])),
        camera_2: rng.chance(0.5).then_some(RobotPose::from_units([0, 0, 5000, 0])),
        grip_dwell: 50 * MS,
        place_dwell: [Duration::ZERO, 20 * MS][rng.below(2)],
        order_timeout: 5 * S,
        motion_timeout: 10 * S,
        ..TaskConfig::DEFAULT
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
        slips: false,
        stuck_high: false,
        switch: false,
        bad: rng.unit(),
        is_done: false,
    };
    for station in [&mut cell.robot.wire, &mut cell.platform.wire, &mut cell.conditioning.wire] {
        station.poll_late(0.002 * cell.bad);
    }
    let parts = 1 + rng.below(4);
    while cell.ledger.len() < parts && cell.now < LIMIT {
        cell.step(&config, &mut rng);
    }
    let mut tally = Tally::default();
    cell.last_minute(&config, &mut tally, &mut rng);
    for wire in [&cell.robot.wire, &cell.platform.wire, &cell.conditioning.wire] {
        wire.settle(cell.now, &mut tally, 0, |_, _| Check::Nothing);
    }
    cell.ledger.settle(cell.now, log, &mut tally, |_, _| false);
    tally
}

impl Cell {
    /// Runs a minute without faults: a part must be placed, and the task must end.
    fn last_minute(&mut self, config: &TaskConfig, tally: &mut Tally, rng: &mut Rng) {
        for wire in [&mut self.robot.wire, &mut self.platform.wire, &mut self.conditioning.wire] {
            wire.heal(self.now);
        }
        self.bad = 0.0;
        // The next command notices a disconnection that was not noticed before; the conditioning system gets no
        // commands, so clear its flag.
        self.conditioning.cut = false;
        // A step that waits for its caller continues.
        self.entered(self.task.step());
        let end = self.now + 60 * S;
        while self.task.step() != Step::Finished && self.now < end {
            self.step(config, rng);
        }
        if !self.is_done || self.task.step() != Step::Finished {
            self.log.line(self.now, format_args!("!!! no part in a minute, step {:?}", self.task.step()));
            tally.stuck += 1;
        }
    }

    fn step(&mut self, config: &TaskConfig, rng: &mut Rng) {
        let (now, bad, mut received) = (self.now, self.bad, Vec::new());
        self.robot.step(now, config.robot_home, bad, rng, &mut received);
        self.platform.step(now, config.platform_home, bad, rng, &mut received);
        self.conditioning.step(now, config.platform_home, bad, rng, &mut received);
        received.extend(self.look(rng));
        received.extend(self.gripper(rng));
        for event in received {
            self.notify(event);
        }
        if rng.chance(0.0002 * bad) {
            self.notify(Event::Abort);
        }
        self.task.handle_timeout(now);
        self.obey();
        let wires = [&self.platform.wire, &self.conditioning.wire].map(Wire::next_delivery);
        let replies = [
            self.robot.central.poll_timeout(),
            self.platform.central.poll_timeout(),
            self.conditioning.central.poll_timeout(),
        ];
        let connects = [self.robot.connects_at, self.platform.connects_at, self.conditioning.connects_at];
        let arrivals = [
            self.robot.motion.as_ref().map(|motion| motion.end),
            self.platform.motion.as_ref().map(|motion| motion.end),
            self.conditioning.motion.as_ref().map(|motion| motion.end),
        ];
        let own = [self.task.poll_timeout(), self.picture.map(|(at, _)| at)];
        let times = wires.into_iter().chain(replies).chain(arrivals).chain(connects).chain(own);
        // The vacuum is looked at often enough to stop on the way.
        self.now = self.robot.wire.next(now, times.chain([Some(now + 10 * MS)]));
    }

    fn notify(&mut self, event: Event) {
        if !matches!(event, Event::Status { .. }) {
            self.log.line(self.now, format_args!("  for the task: {event:?}"));
        }
        self.task.handle_event(self.now, event);
    }

    /// Returns the requested picture.
    fn look(&mut self, rng: &mut Rng) -> Option<Event> {
        let (_, camera) = self.picture.take_if(|(at, _)| *at <= self.now)?;
        if rng.chance(0.05 * self.bad) {
            return Some(Event::NotFound);
        }
        if camera == 2 {
            return self.open.map(|part| Event::SlotFound { place: place(part) });
        }
        if let Some(part) = self.open.take() {
            // The picture came when it was no longer awaited.
            self.ledger.report(part, ReportedOutcome::NotDone, self.robot.wire.mark());
        }
        let part = self.ledger.send(self.robot.wire.mark());
        (self.open, self.part, self.held) = (Some(part), Some(part), false);
        self.slips = rng.chance(0.3 * self.bad);
        self.log.line(self.now, format_args!("job {part}: a part"));
        let platform = PlatformPose::from_units([part as i32, 10]);
        Some(Event::PartFound { platform, pick: pick(part) })
    }

    /// Simulates vacuum and part; returns the event of the switch when it changes.
    fn gripper(&mut self, rng: &mut Rng) -> Option<Event> {
        let (bad, pose) = (self.bad, self.robot.pose(self.now));
        if rng.chance(0.0005 * bad) {
            self.stuck_high = true;
        }
        match self.part {
            Some(part) if self.held && !self.vacuum => {
                self.log.line(self.now, format_args!("  part {part} is put down at {:?}", pose.units()));
                if pose == place(part) {
                    self.ledger.execute(part);
                }
                (self.part, self.held) = (None, false);
            }
            // The part falls on the way.
            Some(part) if self.held && pose != place(part) && rng.chance(0.002 * bad) => {
                self.log.line(self.now, format_args!("  part {part} falls"));
                (self.part, self.held) = (None, false);
            }
            Some(part) if self.vacuum && pose == pick(part) && !self.slips => {
                self.held |= rng.chance(1.0 - 0.2 * bad);
            }
            _ => {}
        }
        let high = self.held || self.stuck_high;
        (core::mem::replace(&mut self.switch, high) != high).then_some(Event::Switch { high })
    }

    fn obey(&mut self) {
        while let Some(output) = self.task.poll_output(self.now) {
            if !matches!(output, Output::Robot(Command::Status) | Output::Platform(Command::Status)) {
                self.log.line(self.now, format_args!("  task: {output:?}"));
            }
            match output {
                Output::Robot(command) => self.robot.request(command),
                Output::Platform(command) => self.platform.request(command),
                Output::Conditioning(command) => self.conditioning.request(command),
                Output::Acquire { camera } => self.picture = Some((self.now + 30 * MS, camera)),
                Output::Grip { gripper, open } => {
                    if gripper == VACUUM {
                        self.vacuum = open;
                    }
                    self.notify(Event::Done(task::Device::Gripper));
                }
                Output::Entered(step) => self.entered(step),
                _ => {}
            }
        }
    }

    /// Handles the task's entry into a step: the operator learns of outcomes, and makes requests.
    fn entered(&mut self, step: Step) {
        let reported = match step {
            Step::Placed => ReportedOutcome::Done,
            Step::GiveUp | Step::NothingFound => ReportedOutcome::NotDone,
            Step::Faulted => ReportedOutcome::Unknown,
            Step::Unpicked => {
                self.notify(Event::Next);
                return;
            }
            _ => return,
        };
        self.is_done |= self.bad == 0.0 && step == Step::Placed && self.open.is_some();
        if let Some(part) = self.open.take() {
            self.ledger.report(part, reported, self.robot.wire.mark());
        }
        match step {
            Step::Placed | Step::NothingFound => {
                self.notify(if self.is_done { Event::Finish } else { Event::Next });
            }
            Step::Faulted => {
                self.stuck_high = false;
                self.notify(Event::Recover);
            }
            _ => {}
        }
    }
}
