//! A central controller and a robot over TCP. A job is a motion or an override.

mod robot;

use core::time::Duration;

use mmacell_proto::robot_session::Session as _;
use mmacell_proto::{
    Central, CentralConfig, CentralEvent, Closing, Command, DeviceEvent, ErrorCode, Mode, Order, Progress,
    Rejection, RobotPose, Unfinished,
};

use self::robot::{Line, Robot};
use super::{Check, Ledger, Log, Reported, Row, Tally, Wire};
use crate::link::{End, Faults};
use crate::links::mmacell_proto::{any_central, any_device};
use crate::model::walk;
use crate::turn;
use robot_session::contract::Rng;

pub(super) const TCP: Row =
    Row { link: "mmacell-proto", transport: "tcp", job: "commands", one_in: None, session };

pub(super) const ANY_CENTRAL: Row =
    Row { transport: "tcp, any central", session: |seed, log| walk(&any_central(true), seed, log), ..TCP };
pub(super) const ANY_DEVICE: Row =
    Row { transport: "tcp, any device", session: |seed, log| walk(&any_device(true), seed, log), ..TCP };
pub(super) const HOSTILE_CENTRAL: Row = Row {
    transport: "tcp, hostile central",
    session: |seed, log| walk(&any_central(false), seed, log),
    ..TCP
};
pub(super) const HOSTILE_DEVICE: Row =
    Row { transport: "tcp, hostile device", session: |seed, log| walk(&any_device(false), seed, log), ..TCP };

const MS: Duration = Duration::from_millis(1);
const S: Duration = Duration::from_secs(1);
const LIMIT: Duration = Duration::from_secs(3600);
const HOME: RobotPose = RobotPose::ORIGIN;
/// Where the robot is sent when nothing goes wrong any more.
const LAST: RobotPose = RobotPose::from_units([-7, -7, -7, -7]);

struct Cell {
    now: Duration,
    log: Log,
    wire: Wire,
    rng: Rng,
    ledger: Ledger,
    invented: u64,
    central: Central<RobotPose>,
    robot: Robot,
    /// No byte arrives, and no end is notified of it.
    cut: bool,
    /// When the central controller connects again.
    connects_at: Option<Duration>,
    /// The job that is not finished.
    under_way: Option<usize>,
    /// The motion that the robot has agreed to last.
    target: Option<RobotPose>,
    /// The robot arrived at the last target.
    is_done: bool,
    sent: Vec<Order<RobotPose>>,
    /// How often things go wrong: 0 in the last minute.
    bad: f64,
}

fn session(seed: u64, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let bad = rng.unit();
    // Some delays outlast the central controller's patience.
    let faults = Faults {
        disconnect: 0.1 * bad,
        max_delay: [300 * MS, 1500 * MS][rng.below(2)],
        pause: 50 * MS,
        stall: 0.05 * bad,
        ..Faults::TCP
    };
    let mut cell = Cell {
        now: Duration::ZERO,
        log,
        wire: Wire::new(seed, faults, ["central", "robot"], true, log),
        ledger: Ledger::default(),
        invented: 0,
        central: Central::new(CentralConfig::DEFAULT).unwrap(),
        robot: Robot::new(HOME),
        cut: false,
        connects_at: Some(Duration::ZERO),
        under_way: None,
        target: None,
        is_done: false,
        sent: Vec::new(),
        bad,
        rng,
    };
    cell.wire.poll_late(0.02 * bad);
    let jobs = 5 + cell.rng.below(36);
    while cell.ledger.len() < jobs && cell.now < LIMIT {
        cell.command();
        cell.step();
    }
    let mut tally = Tally::default();
    cell.last_minute(&mut tally);
    tally.invented = cell.invented;
    cell.wire.settle(cell.now, &mut tally, 0, |_, _| Check::Nothing);
    cell.ledger.settle(cell.now, log, &mut tally, |_| false);
    tally
}

impl Cell {
    /// Nothing goes wrong any more: the robot has to arrive where it is sent.
    fn last_minute(&mut self, tally: &mut Tally) {
        self.wire.heal(self.now);
        if let Some(job) = self.under_way.take() {
            self.ledger.report(job, Reported::Unknown, self.wire.mark());
        }
        (self.bad, self.cut) = (0.0, false);
        let end = self.now + 60 * S;
        while !self.is_done && self.now < end {
            if self.central.is_idle() {
                let (works, moves) = self.status();
                let command = match (works, self.target == Some(LAST)) {
                    (false, _) => Command::Reset,
                    (true, false) if !moves => Command::Move { mode: Mode::Absolute, pose: LAST },
                    _ => Command::Status,
                };
                self.request(command, None);
            }
            self.step();
        }
        if !self.is_done {
            self.log.line(self.now, format_args!("!!! the robot has not arrived in a minute"));
            tally.stuck += 1;
        }
    }

    /// Requests the next command, when the last one is finished.
    fn command(&mut self) {
        if !self.central.is_idle() {
            return;
        }
        let (works, moves) = self.status();
        let number = self.sent.len() as i32 + 1;
        let target = RobotPose::from_units([number, -number, 3 * number, 7]);
        let (command, order) = match self.rng.below(10) {
            0 => (Command::Status, None),
            1 => {
                let percent = (number % 101) as u8;
                (Command::Override { percent }, Some(Order::Override { percent }))
            }
            2 if self.rng.chance(0.3) => (Command::Stop, None),
            // The robot has neither.
            3 if self.rng.chance(0.2) => (Command::Acquire { camera: 1 }, None),
            4 if self.rng.chance(0.2) => (Command::Close, None),
            _ if !works => (Command::Reset, None),
            // Most motions wait for the one before; the others are refused.
            _ if moves && self.rng.chance(0.9) => (Command::Status, None),
            _ => (Command::Move { mode: Mode::Absolute, pose: target }, Some(Order::Move { target })),
        };
        self.request(command, order);
    }

    /// Whether the robot can be moved, and whether it moves.
    fn status(&self) -> (bool, bool) {
        let status = self.robot.device.status();
        let works = status.is_some_and(|status| status.servo && status.error == ErrorCode::None);
        (works, status.is_some_and(|status| status.moving))
    }

    /// The robot carries out an order of the central controller. Overrides come again after 101 jobs: the last one that is the same is
    /// meant.
    fn execute(&mut self, order: Order<RobotPose>) {
        let job = self.sent.iter().rposition(|sent| *sent == order);
        if !job.is_some_and(|job| self.ledger.execute(job)) {
            self.log.line(self.now, format_args!("!!! nobody sent {order:?}"));
            self.invented += 1;
        }
    }

    fn request(&mut self, command: Command<RobotPose>, order: Option<Order<RobotPose>>) {
        self.central.request(command).unwrap();
        self.under_way = order.map(|order| {
            self.sent.push(order);
            self.ledger.send(self.wire.mark())
        });
    }

    fn step(&mut self) {
        let robot = [self.robot.arrival.map(|(at, _)| at), self.robot.asked.map(|(at, _)| at)];
        let central = [self.central.poll_timeout(), self.connects_at];
        let times = robot.into_iter().chain(central);
        // The line is silent where it is cut: time passes there, too.
        let silent = self.cut.then_some(self.now + 100 * MS);
        self.now = self.wire.next(self.now, times.chain([silent]));
        self.fail();
        self.connect();
        self.turn_robot();
        self.turn_central();
    }

    /// What goes wrong beside the transport.
    fn fail(&mut self) {
        let (now, log, bad) = (self.now, self.log, self.bad);
        if self.rng.chance(0.005 * bad) {
            log.line(now, format_args!("  the robot fails"));
            self.robot.device.fail(ErrorCode::Servo1);
            self.robot.arrival = None;
        }
        if self.rng.chance(0.004 * bad) {
            log.line(now, format_args!("  the robot restarts"));
            self.robot = Robot::new(self.robot.pose);
            // Half of the time the central controller is not notified: its commands are not answered.
            if self.rng.chance(0.5) {
                self.wire.disconnect(now);
            }
            self.cut = true;
        }
        if self.rng.chance(0.004 * bad) {
            log.line(now, format_args!("  the central controller restarts"));
            self.central = Central::new(CentralConfig::DEFAULT).unwrap();
            if let Some(job) = self.under_way.take() {
                // Nobody is left who knows.
                self.ledger.report(job, Reported::Unknown, self.wire.mark());
            }
            self.connects_at = Some(now + self.rng.log_uniform(MS, 10 * S));
            self.cut = true;
        }
        if self.rng.chance(0.004 * bad) {
            log.line(now, format_args!("  the line is cut"));
            self.cut = true;
        }
        if self.rng.chance(0.01 * bad) {
            log.line(now, format_args!("  the caller aborts"));
            self.central.abort(now);
        }
    }

    /// A new connection; the robot may not know that the one before is gone.
    fn connect(&mut self) {
        if self.connects_at.take_if(|at| *at <= self.now).is_none() {
            return;
        }
        self.cut = false;
        self.wire.reconnect(self.now);
        self.robot.device.handle_connected(self.now);
        self.central.handle_connected(self.now);
    }

    fn turn_robot(&mut self) {
        let Self { robot, wire, cut, now, rng, log, invented, bad, .. } = self;
        let (now, log, bad) = (*now, *log, *bad);
        let mut executed = Vec::new();
        if let Some((_, pose)) = robot.arrival.take_if(|(at, _)| *at <= now) {
            robot.pose = pose;
            robot.device.set_pose(pose);
            robot.device.arrived();
        }
        let mut line = Line { wire, cut: *cut };
        let due = robot.asked.take_if(|(at, _)| *at <= now).map(|(_, order)| order);
        let mut asked = due;
        loop {
            if let Some(order) = asked.take() {
                let refuses = rng.chance(0.03 * bad) || matches!(order, Order::Acquire { .. });
                if refuses {
                    let code = ErrorCode::from([1, 2, 77, -1, 32_767][rng.below(5)]);
                    let _ = robot.device.refuse(order, code);
                } else if robot.device.accept(order).is_ok() {
                    log.line(now, format_args!("  robot: {order:?}"));
                    robot.carry_out(now, order, rng, bad);
                    if matches!(order, Order::Move { target } if target != LAST)
                        || matches!(order, Order::Override { .. })
                    {
                        executed.push(order);
                    }
                }
            }
            let mut pending = None;
            turn(&mut line, End::B, &mut robot.device, now, |_, event| match event {
                DeviceEvent::Asked { order } => pending = Some(order),
                DeviceEvent::Rejected { reason: Rejection::Malformed(error) } => {
                    log.line(now, format_args!("!!! TCP corrupts nothing: {error}"));
                    *invented += 1;
                }
                DeviceEvent::Unexpected(unexpected) => {
                    log.line(now, format_args!("!!! {unexpected}"));
                    *invented += 1;
                }
                _ => {}
            });
            match pending {
                None => break,
                // Some owners take their time: the central controller may have given up until then.
                Some(order) if rng.chance(0.05 * bad) => {
                    robot.asked = Some((now + rng.log_uniform(MS, 3 * S), order));
                }
                order => asked = order,
            }
        }
        executed.into_iter().for_each(|order| self.execute(order));
    }

    fn turn_central(&mut self) {
        let (now, log) = (self.now, self.log);
        let mut events = Vec::new();
        let mut line = Line { wire: &mut self.wire, cut: self.cut };
        turn(&mut line, End::A, &mut self.central, now, |_, event| events.push(event));
        for event in events {
            log.line(now, format_args!("  central: {event:?}"));
            let reported = match event {
                CentralEvent::Connected => continue,
                CentralEvent::Done { command } => {
                    if let Command::Move { pose, .. } = command {
                        self.target = Some(pose);
                    }
                    Reported::Done
                }
                CentralEvent::Refused { .. } | CentralEvent::Aborted { .. } => Reported::NotDone,
                CentralEvent::Status { status, motion } => {
                    if motion == Progress::Arrived {
                        self.check_arrival(status.pose, status.servo);
                    }
                    continue;
                }
                CentralEvent::Closed { reason, unfinished } => {
                    if let Closing::Malformed(_) | Closing::Mismatch = reason {
                        log.line(now, format_args!("!!! TCP corrupts nothing"));
                        self.invented += 1;
                    }
                    self.hang_up();
                    match unfinished {
                        Unfinished::Nothing => continue,
                        Unfinished::NotSent(_) => Reported::NotDone,
                        Unfinished::Unknown(_) => Reported::Unknown,
                    }
                }
                other => {
                    log.line(now, format_args!("!!! {other:?}"));
                    self.invented += 1;
                    continue;
                }
            };
            if let Some(job) = self.under_way.take() {
                self.ledger.report(job, reported, self.wire.mark());
            }
        }
    }

    /// Closes what is left of the connection. Half of the time the robot is not notified before the next one.
    fn hang_up(&mut self) {
        self.target = None;
        if self.wire.is_connected() && self.rng.chance(0.5) {
            self.wire.disconnect(self.now);
        }
        self.connects_at = Some(self.now + self.rng.log_uniform(MS, S));
    }

    fn check_arrival(&mut self, pose: RobotPose, servo: bool) {
        if !servo || self.target != Some(pose) {
            self.log.line(self.now, format_args!("!!! it has not arrived"));
            self.invented += 1;
        }
        self.is_done = self.bad == 0.0 && pose == LAST && self.robot.pose == LAST;
    }
}
