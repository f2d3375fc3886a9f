//! A controller and a robot over TCP. A job is a motion or an override.

use core::time::Duration;

use mmacell_proto::controller::{Closing, Config, Controller, Event};
use mmacell_proto::device::{Device, Event as Order, Rejection};
use mmacell_proto::state::{Connection, Motion};
use mmacell_proto::{Command, Dialect, ErrorCode, Mode, RobotPose};

use super::{Check, Ledger, Log, Row, Tally, Told, Wire};
use crate::link::{Delivery, End, Faults};
use crate::rng::Rng;

pub(super) const TCP: Row =
    Row { link: "mmacell-proto", transport: "tcp", job: "commands", one_in: None, session };

const MS: Duration = Duration::from_millis(1);
const LIMIT: Duration = Duration::from_secs(3600);
const HOME: RobotPose = RobotPose::ORIGIN;

struct Cell {
    now: Duration,
    log: Log,
    wire: Wire,
    ledger: Ledger,
    invented: u64,
    controller: Controller<RobotPose>,
    device: Device<RobotPose>,
    inbox: Vec<u8>,
    /// When the axes stand, and where.
    arrival: Option<(Duration, RobotPose)>,
    /// Which ends have heard that the connection is gone.
    gone: [bool; 2],
    /// The commands that are jobs, by what the device makes of them.
    under_way: Option<usize>,
    sent: Vec<Order<RobotPose>>,
}

fn session(seed: u64, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let bad = rng.unit();
    // Some delays outlast the controller's patience.
    let faults = Faults {
        disconnect: 0.1 * bad,
        max_delay: [300 * MS, 1500 * MS][rng.below(2)],
        pause: 50 * MS,
        ..Faults::TCP
    };
    let mut cell = Cell {
        now: Duration::ZERO,
        log,
        wire: Wire::new(seed, faults, ["controller", "robot"], true, log),
        ledger: Ledger::default(),
        invented: 0,
        controller: Controller::new(Config::DEFAULT),
        device: Device::new(HOME, Dialect::STRICT),
        inbox: Vec::new(),
        arrival: None,
        gone: [false; 2],
        under_way: None,
        sent: Vec::new(),
    };
    let jobs = 5 + rng.below(36);
    while cell.ledger.len() < jobs && cell.now < LIMIT {
        cell.command(&mut rng);
        cell.step(&mut rng);
    }
    let end = cell.now + 10 * Duration::from_secs(1);
    while cell.now < end && (cell.under_way.is_some() || !cell.inbox.is_empty()) {
        cell.step(&mut rng);
    }
    let mut tally = Tally { invented: cell.invented, ..Tally::default() };
    cell.wire.settle(cell.now, &mut tally, 0, |_, _| Check::Nothing);
    cell.ledger.settle(cell.now, log, &mut tally, |_| false);
    tally
}

impl Cell {
    /// Sends the next command, when the last one is done with.
    fn command(&mut self, rng: &mut Rng) {
        if self.controller.connection() != Connection::Idle || self.gone != [false; 2] {
            return;
        }
        let status = self.device.status();
        let number = self.sent.len() as i32 + 1;
        let target = RobotPose::from_units([number, -number, 3 * number, 7]);
        let (command, order) = match rng.below(10) {
            0 => (Command::Status, None),
            1 => {
                let percent = (number % 101) as u8;
                (Command::Override { percent }, Some(Order::Override { percent }))
            }
            2 if rng.chance(0.3) => (Command::Stop, None),
            // The device has neither.
            3 if rng.chance(0.2) => (Command::Acquire { camera: 1 }, None),
            4 if rng.chance(0.2) => (Command::Close, None),
            _ if !status.servo || status.error != ErrorCode::None => (Command::Reset, None),
            // Most motions wait for the one before; the others are refused.
            _ if self.controller.motion() != Motion::Still && rng.chance(0.9) => (Command::Status, None),
            _ => {
                let pose = target;
                (Command::Move { mode: Mode::Absolute, pose }, Some(Order::Move { target }))
            }
        };
        self.controller.send(command).unwrap();
        self.under_way = order.map(|order| {
            self.sent.push(order);
            self.ledger.send(self.wire.mark())
        });
    }

    fn step(&mut self, rng: &mut Rng) {
        let mut buffer = [0; 64];
        while let Some(len) = self.controller.poll_transmit(self.now, &mut buffer) {
            self.wire.send(End::A, self.now, &buffer[..len]);
        }
        let arrival = self.arrival.map(|(at, _)| at);
        self.now = self.wire.next(self.now, [self.controller.poll_timeout(), arrival]);
        self.controller.handle_timeout(self.now);
        if let Some((_, pose)) = self.arrival.take_if(|(at, _)| *at <= self.now) {
            self.device.set_pose(pose);
            self.device.arrived();
        }
        if rng.chance(0.005) {
            self.log.say(self.now, format_args!("  the robot fails"));
            self.device.fail(ErrorCode::Servo1);
            self.arrival = None;
        }
        while let Some(delivery) = self.wire.receive(End::B, self.now) {
            match delivery {
                Delivery::Bytes(bytes) => self.inbox.extend(bytes),
                Delivery::Closed => self.gone[1] = true,
            }
        }
        self.obey(rng);
        while let Some(delivery) = self.wire.receive(End::A, self.now) {
            match delivery {
                Delivery::Bytes(bytes) => self.controller.handle_input(self.now, &bytes),
                Delivery::Closed => {
                    self.gone[0] = true;
                    self.controller.handle_disconnect();
                }
            }
        }
        self.hear();
        if self.gone == [true; 2] {
            // What was heard of the old connection has been obeyed.
            self.wire.reconnect(self.now);
            self.inbox.clear();
            self.device.connect();
            self.controller = Controller::new(Config::DEFAULT);
            self.gone = [false; 2];
        }
    }

    fn obey(&mut self, rng: &mut Rng) {
        while !self.inbox.is_empty() {
            let taken = self.device.handle_input(self.now, &self.inbox);
            self.inbox.drain(..taken);
            let event = self.device.poll_event();
            if let Some(order) = event {
                self.log.say(self.now, format_args!("  robot: {order:?}"));
                match order {
                    Order::Move { target } => {
                        self.execute(order);
                        let time = Duration::from_millis(rng.below(300) as u64);
                        self.arrival = Some((self.now + time, target));
                    }
                    Order::Override { .. } => self.execute(order),
                    Order::Home => self.arrival = Some((self.now + 50 * MS, HOME)),
                    Order::Stop => {
                        self.arrival = None;
                        self.device.arrived();
                    }
                    Order::Rejected { reason: Rejection::Malformed(error) } => {
                        self.log.say(self.now, format_args!("!!! TCP damages nothing: {error}"));
                        self.invented += 1;
                    }
                    _ => {}
                }
            }
            let mut buffer = [0; 64];
            while let Some(len) = self.device.poll_transmit(self.now, &mut buffer) {
                self.wire.send(End::B, self.now, &buffer[..len]);
            }
            if taken == 0 && event.is_none() {
                break;
            }
        }
    }

    fn execute(&mut self, order: Order<RobotPose>) {
        // Overrides come again after 101 jobs: the last one that is the same is meant.
        let job = self.sent.iter().rposition(|sent| *sent == order);
        if !job.is_some_and(|job| self.ledger.execute(job)) {
            self.log.say(self.now, format_args!("!!! nobody sent {order:?}"));
            self.invented += 1;
        }
    }

    fn hear(&mut self) {
        while let Some(event) = self.controller.poll_event() {
            self.log.say(self.now, format_args!("  controller: {event:?}"));
            let told = match event {
                Event::Done { .. } => Told::Done,
                Event::Refused { .. } => Told::NotDone,
                Event::Closed { reason, .. } => {
                    if let Closing::Malformed(_) | Closing::Unexpected = reason {
                        self.log.say(self.now, format_args!("!!! TCP damages nothing"));
                        self.invented += 1;
                    }
                    if self.wire.is_connected() {
                        self.wire.disconnect(self.now);
                    }
                    Told::Unknown
                }
                _ => continue,
            };
            if let Some(job) = self.under_way.take() {
                self.ledger.tell(job, told, self.wire.mark());
            }
        }
    }
}
