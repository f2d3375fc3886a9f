//! A robot and a PC over TCP and UDP. A job is a line of a picture.
//!
//! The robot is the session in Rust, or a controller with the AS program in it.

mod picture;

use core::num::NonZeroU16;
use core::time::Duration;

use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{Acks, LargePc, PcConfig, PcEvent, RobotConfig, RobotEvent, Takeover};

use self::picture::{Picture, line};
use super::{Check, Ledger, Log, ReportedOutcome, Row, Tally, Wire};
use crate::controller::{AsRobot, Controller, Native};
use crate::link::{Delivery, End, Faults};
use robot_session::contract::Rng;

pub(super) const TCP: Row = Row {
    link: "kawasaki-msg",
    transport: "tcp",
    job: "lines",
    one_in: None,
    session: |seed, log| session::<Native>(seed, false, log),
};

pub(super) const UDP: Row =
    Row { transport: "udp", session: |seed, log| session::<Native>(seed, true, log), ..TCP };

/// Over TCP; the robot is the AS program.
pub(super) const AS: Row =
    Row { transport: "as", session: |seed, log| session::<AsRobot>(seed, false, log), ..TCP };

const MS: Duration = Duration::from_millis(1);
/// An order that has not ended by then is stalled.
const LIMIT: Duration = Duration::from_secs(600);

/// An interference with an order, besides the faults of the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mishap {
    PcInterrupts,
    PcEnds,
    RobotResets,
    RobotClears,
    RobotRestarts,
    PcRestarts,
    Disconnect,
    HalfOpen,
}

struct Cell<C> {
    now: Duration,
    log: Log,
    wire: Wire,
    ledger: Ledger,
    invented: u64,
    config: (RobotConfig, PcConfig),
    capacity: usize,
    robot: C,
    pc: LargePc<Picture>,
    /// The time of a job, and the time at which the next one is taken.
    pace: Duration,
    motion_at: Duration,
    overtakes: bool,
    last: Option<usize>,
    /// The number of attempts to connect that fail.
    unreachable: u32,
    order: Option<Order>,
    /// The connection is gone, and neither end notices it.
    half_open: bool,
}

/// The order that the PC's user waits for.
#[derive(Debug)]
struct Order {
    picture: Picture,
    ahead: Vec<u32>,
}

fn session<C: Controller>(seed: u64, datagrams: bool, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let mut cell = Cell::<C>::new(seed, datagrams, &mut rng, log);
    for order in 1..=1 + rng.below(3) as u16 {
        // Over UDP, "give every order a new number"; over TCP one may be used again at once.
        let order = if datagrams { order } else { 1 + rng.below(2) as u16 };
        cell.start(order, 1 + rng.below(24) as u32, [0.5, 0.1, 0.0][rng.below(3)]);
        let end = cell.now + LIMIT;
        for _ in 0..[0, 1, 1, 3][rng.below(4)] {
            let mishap = match rng.below(8) {
                0 => Mishap::PcInterrupts,
                1 => Mishap::PcEnds,
                2 => Mishap::RobotResets,
                3 => Mishap::RobotClears,
                4 => Mishap::RobotRestarts,
                5 => Mishap::PcRestarts,
                6 => Mishap::HalfOpen,
                _ => Mishap::Disconnect,
            };
            let at = cell.now + MS * rng.below(700) as u32;
            while cell.order.is_some() && cell.now < at {
                cell.step();
            }
            if cell.order.is_some() {
                cell.meet(mishap);
            }
        }
        while cell.order.is_some() && cell.now < end {
            cell.step();
        }
        if cell.order.is_some() {
            log.line(cell.now, format_args!("the order is stalled"));
            break;
        }
    }
    let stuck = cell.order.is_none() && !cell.works_when_healed();
    // Jobs that are still queued must not be executed any more, unless their outcome was reported as unknown.
    let end = cell.now + MS * 300;
    while cell.now < end {
        cell.step();
    }
    let mut tally = Tally { invented: cell.invented, stuck: u64::from(stuck), ..Tally::default() };
    cell.wire.settle(cell.now, &mut tally, 0, |_, _| Check::Nothing);
    cell.ledger.settle(cell.now, log, &mut tally, |_, _| false);
    tally
}

impl<C: Controller> Cell<C> {
    fn new(seed: u64, datagrams: bool, rng: &mut Rng, log: Log) -> Self {
        let (robot, pc) = match datagrams {
            false => (RobotConfig::tcp(), PcConfig::tcp()),
            true => (RobotConfig::udp(), PcConfig::udp()),
        };
        let (capacity, max_number) = [(1, 2), (3, 5), (10, 17), (32, 200), (32, 9999)][rng.below(5)];
        // Over datagrams a number must not come again while an old datagram may still name it.
        let max_number = if datagrams { max_number.max(1000) } else { max_number };
        let overtakes = rng.chance(0.3) && C::WHOLE;
        let every = [1, 1, 2, 5, 100][rng.below(5)];
        let acks = match overtakes {
            true => Acks::Individual,
            false => Acks::Cumulative { every: NonZeroU16::new(every).unwrap_or(NonZeroU16::MIN) },
        };
        let robot = RobotConfig {
            acks,
            refuse_repeated_start: rng.chance(0.7),
            max_number,
            end_foreign_order: rng.chance(0.2),
            ..robot
        };
        let takeover = [Takeover::Interrupt, Takeover::Interrupt, Takeover::End, Takeover::Never];
        let takeover = takeover[rng.below(4)];
        let pc = PcConfig { cumulative_acks: !overtakes, max_number, takeover, ..pc };
        let bad = rng.unit();
        let faults = match datagrams {
            // Some answers come when the robot has begun another cycle.
            false => Faults {
                disconnect: 0.08 * bad,
                pause: 120 * MS,
                // Of 1 ms to 10 s.
                stall: [0.0, 0.03, 0.15][rng.below(3)] * bad,
                max_delay: [300 * MS, 4000 * MS][rng.below(2)],
                ..Faults::TCP
            },
            true => Faults {
                lose: 0.15 * bad,
                repeat: 0.15 * bad,
                delay: 0.2,
                max_delay: [50 * MS, 490 * MS][rng.below(2)],
                ..Faults::UDP
            },
        };
        let mut wire = Wire::new(seed, faults, ["robot", "PC"], true, log);
        wire.poll_late([0.0, 0.0, 0.002, 0.02][rng.below(4)]);
        Self {
            now: Duration::ZERO,
            log,
            wire,
            ledger: Ledger::default(),
            invented: 0,
            config: (robot, pc),
            capacity,
            robot: C::begin(robot, capacity, seed),
            pc: LargePc::with_ranges(pc, Default::default()).unwrap(),
            pace: [MS / 10, MS, 7 * MS, 40 * MS][rng.below(4)],
            motion_at: Duration::ZERO,
            overtakes,
            last: None,
            unreachable: rng.below(3) as u32,
            order: None,
            half_open: false,
        }
    }

    fn start(&mut self, order: u16, jobs: u32, later: f64) {
        let rng = Rng::new(u64::from(order) << 32 | self.ledger.len() as u64);
        let picture = Picture { first: self.ledger.len(), jobs, later, rng };
        self.log.line(self.now, format_args!("order {order} of {jobs} jobs from {}", picture.first));
        for _ in 0..jobs {
            self.ledger.send(self.wire.mark());
        }
        self.order = Some(Order { picture: picture.clone(), ahead: Vec::new() });
        self.pc.start(order, picture).unwrap();
    }

    fn meet(&mut self, mishap: Mishap) {
        self.log.line(self.now, format_args!("{mishap:?}"));
        let (robot, pc) = self.config;
        // A mishap that is not possible now is skipped.
        match mishap {
            Mishap::PcInterrupts => _ = self.pc.interrupt(),
            Mishap::PcEnds => _ = self.pc.end(),
            Mishap::RobotResets => _ = self.robot.reset_order(),
            Mishap::RobotClears => _ = self.robot.clear_queue(),
            Mishap::Disconnect | Mishap::HalfOpen if robot.datagrams => {}
            Mishap::HalfOpen => self.half_open = true,
            Mishap::Disconnect => self.wire.disconnect(self.now),
            Mishap::RobotRestarts => {
                self.lose_connection();
                self.robot = C::begin(robot, self.capacity, self.ledger.len() as u64);
            }
            // The robot's user knows of the restart, and of nothing more.
            Mishap::PcRestarts => {
                self.lose_connection();
                self.pc = LargePc::with_ranges(pc, Default::default()).unwrap();
                if self.config.0.datagrams {
                    self.pc.handle_connected(self.now);
                }
                self.over(0, u32::MAX);
            }
        }
    }

    /// Returns the next delivery to an end that can have one.
    fn receive(&mut self, end: End) -> Option<Delivery> {
        let delivery = self.wire.receive(end, self.now)?;
        if self.half_open { self.receive(end) } else { Some(delivery) }
    }

    fn send(&mut self, end: End, packet: &[u8]) {
        if !self.half_open {
            self.wire.send(end, self.now, packet);
        }
    }

    /// Runs a minute without faults, in which a requested order must be executed; returns whether it was.
    fn works_when_healed(&mut self) -> bool {
        self.wire.heal(self.now);
        self.unreachable = 0;
        let end = self.now + MS * 60_000;
        // The motion program ends an order that no PC knows and none may take over.
        if self.config.1.takeover == Takeover::Never {
            _ = self.robot.reset_order();
        }
        while self.robot.order().is_some() && self.config.1.takeover == Takeover::Never && self.now < end {
            self.step();
        }
        self.start(900, 3, 0.0);
        while self.order.is_some() && self.now < end {
            self.step();
        }
        self.order.is_none()
    }

    /// Loses the connection; has no effect over datagrams.
    fn lose_connection(&mut self) {
        if !self.config.0.datagrams {
            self.wire.disconnect(self.now);
        }
    }

    /// Jobs of the order before `executed` are executed, those from `sent` on are not; the outcome of those between is unknown.
    fn over(&mut self, executed: u32, sent: u32) {
        let Some(order) = self.order.take() else { return };
        self.log.line(self.now, format_args!("over: {executed} executed, unknown up to {sent}"));
        let mark = self.wire.mark();
        for index in 0..order.picture.jobs {
            let reported = match index {
                _ if index < executed || order.ahead.contains(&index) => ReportedOutcome::Done,
                _ if index < sent => ReportedOutcome::Unknown,
                _ => ReportedOutcome::NotDone,
            };
            self.ledger.report(order.picture.first + index as usize, reported, mark);
        }
    }

    fn step(&mut self) {
        self.motion_task();
        self.robot_pass();
        self.pc_pass();
        let motion = self.robot.has_jobs().then_some(self.motion_at);
        // A cleared queue is seen in the next pass.
        let pass = Some(self.now + 20 * MS);
        let times = [self.robot.poll_timeout(), self.pc.poll_timeout(), motion, pass];
        self.now = self.wire.next(self.now, times);
    }

    fn motion_task(&mut self) {
        while self.motion_at <= self.now {
            let Some(job) = self.robot.execute(self.now, self.overtakes) else {
                self.motion_at = self.now + MS;
                return;
            };
            let number = job.work.start.x as usize;
            self.log.line(self.now, format_args!("  job {number} (its number {}) is executed", job.number));
            if job.work != line(number) || !self.ledger.execute(number) {
                self.log.line(self.now, format_args!("!!! nobody sent {job:?}"));
                self.invented += 1;
            }
            if !self.overtakes && self.last.replace(number).is_some_and(|last| last > number) {
                self.log.line(self.now, format_args!("!!! it has been overtaken"));
                self.invented += 1;
            }
            self.motion_at += self.pace;
        }
    }

    fn robot_pass(&mut self) {
        while let Some(delivery) = self.receive(End::A) {
            match delivery {
                Delivery::Bytes(bytes) => self.robot.handle_input(self.now, &bytes),
                Delivery::Closed => self.robot.handle_disconnected(self.now),
            }
        }
        self.robot.report(self.now);
        self.robot.handle_timeout(self.now);
        while let Some(event) = self.robot.poll_event() {
            self.log.line(self.now, format_args!("  robot: {event:?}"));
            match event {
                RobotEvent::Connect if self.unreachable > 0 => {
                    self.unreachable -= 1;
                    self.robot.handle_disconnected(self.now);
                }
                RobotEvent::Connect => {
                    self.half_open = false;
                    if !self.config.0.datagrams {
                        self.wire.reconnect(self.now);
                        self.pc.handle_disconnected(self.now);
                    }
                    self.pc.handle_connected(self.now);
                    self.robot.handle_connected(self.now);
                }
                RobotEvent::Disconnect => {
                    self.lose_connection();
                    self.robot.handle_disconnected(self.now);
                }
                // The motion program deals with it.
                RobotEvent::Alarm { .. } => {
                    // A controller may be out of it before its line is read.
                    assert!(self.robot.clear_queue().is_ok() || !C::WHOLE);
                }
                _ => {}
            }
        }
        let mut out = [0; 4096];
        while let Some(len) = self.robot.poll_transmit(self.now, &mut out) {
            self.send(End::A, &out[..len]);
        }
    }

    fn pc_pass(&mut self) {
        while let Some(delivery) = self.receive(End::B) {
            match delivery {
                Delivery::Bytes(bytes) => self.pc.handle_input(self.now, &bytes),
                Delivery::Closed => self.pc.handle_disconnected(self.now),
            }
        }
        self.pc.handle_timeout(self.now);
        while let Some(event) = self.pc.poll_event() {
            self.log.line(self.now, format_args!("  PC: {event:?}"));
            match event {
                PcEvent::Disconnect => {
                    self.lose_connection();
                    self.pc.handle_disconnected(self.now);
                    if self.config.0.datagrams {
                        self.pc.handle_connected(self.now);
                    }
                }
                PcEvent::ExecutedAhead { index } => {
                    self.order.iter_mut().for_each(|order| order.ahead.push(index));
                }
                PcEvent::OrderOver { executed, .. } => self.over(executed, executed),
                PcEvent::OutcomeUnknown { executed, sent, .. } => self.over(executed, sent),
                PcEvent::OrderRefused { given_up: true, .. } => self.over(0, 0),
                _ => {}
            }
        }
        let mut out = [0; 4096];
        while let Some(len) = self.pc.poll_transmit(self.now, &mut out) {
            self.send(End::B, &out[..len]);
        }
    }
}
