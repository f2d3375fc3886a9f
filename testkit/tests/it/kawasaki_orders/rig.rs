//! Both ends, the motion task and a faulty link between them, on a virtual clock.
#![allow(unreachable_pub, missing_debug_implementations, reason = "a helper of tests")]

use core::time::Duration;

use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{Job, JobKind, LargePc, Line, PcConfig, PcEvent, Point, RobotConfig, RobotEvent, Supply};
use testkit::controller::Controller;
use testkit::link::{Delivery, End, Faults, Link};

pub const MS: Duration = Duration::from_millis(1);

/// Returns the line with an index in the picture of an order; all lines differ.
pub fn line(order: u16, index: u32) -> Line {
    let kind = if index.is_multiple_of(3) { JobKind::Move } else { JobKind::Draw };
    let (x, y) = (index as i32 * 7 - 3000, i32::from(order) * 11 + index as i32);
    Line { kind, start: Point::new(x, y), end: Point::new(x + 7, y - 13) }
}

/// Returns the first lines of the picture of an order.
pub fn expected(order: u16, jobs: u32) -> Vec<Line> {
    (0..jobs).map(|index| line(order, index)).collect()
}

/// Returns the messages with this name in packets.
pub fn sent(packets: &[Vec<u8>], name: &str) -> Vec<String> {
    let all = String::from_utf8(packets.concat()).unwrap();
    let messages = all.split_inclusive('>').filter(|m| m.starts_with(&format!("<{name}$")));
    messages.map(String::from).collect()
}

type JobSupplier = Box<dyn FnMut(u32) -> Supply<Line>>;

/// Returns an order of `jobs` lines.
pub fn picture(order: u16, jobs: u32) -> JobSupplier {
    Box::new(move |index| if index < jobs { Supply::Job(line(order, index)) } else { Supply::End })
}

pub struct Rig<C> {
    pub now: Duration,
    pub link: Link,
    pub robot: C,
    pub pc: LargePc<JobSupplier>,
    /// The time of a job; `None` while the motion task is stopped.
    pub motion: Option<Duration>,
    pub motion_at: Duration,
    /// Whether the PC accepts connections.
    pub reachable: bool,
    /// The jobs that the motion task has executed.
    pub executed: Vec<Job<Line>>,
    pub robot_events: Vec<RobotEvent>,
    pub pc_events: Vec<PcEvent>,
    /// The packets that each end has sent.
    pub from_robot: Vec<Vec<u8>>,
    pub from_pc: Vec<Vec<u8>>,
}

impl<C: Controller> Rig<C> {
    /// Creates a rig with any robot.
    pub fn new(robot: RobotConfig, pc: PcConfig, capacity: usize) -> Self {
        Self {
            now: Duration::ZERO,
            link: Link::new(1, Faults::NONE),
            robot: C::begin(robot, capacity, 1),
            pc: LargePc::with_ranges(pc, Default::default()).unwrap(),
            motion: Some(MS),
            motion_at: Duration::ZERO,
            reachable: true,
            executed: Vec::new(),
            robot_events: Vec::new(),
            pc_events: Vec::new(),
            from_robot: Vec::new(),
            from_pc: Vec::new(),
        }
    }

    /// Runs one pass of every loop at the current time, then advances to the next time at which something happens.
    pub fn step(&mut self) {
        self.motion_task();
        self.robot_pass();
        self.pc_pass();
        let times = [self.link.next_delivery(), self.robot.poll_timeout(), self.pc.poll_timeout()];
        let motion = self.motion.map(|_| self.motion_at);
        let next = times.into_iter().flatten().chain(motion).filter(|at| *at > self.now).min();
        // A pass may have made something due at once.
        self.now = next.map_or(self.now + MS, |at| at.min(self.now + 20 * MS));
    }

    pub fn run_until(&mut self, limit: Duration, mut done: impl FnMut(&Self) -> bool) {
        while !done(self) {
            assert!(self.now < limit, "still not there at {limit:?}: {}", self.summary());
            self.step();
        }
    }

    pub fn summary(&self) -> String {
        let pc = &self.pc;
        format!(
            "robot {:?}, PC {:?} {:?} {}/{}/{}, {:?}\n{:?}\n{:?}",
            self.robot.order(),
            pc.order(),
            pc.phase(),
            pc.executed(),
            pc.queued(),
            pc.sent(),
            self.robot.statistics(),
            self.robot_events,
            self.pc_events
        )
    }

    pub fn run_for(&mut self, time: Duration) {
        let end = self.now + time;
        while self.now < end {
            self.step();
        }
    }

    pub fn motion_task(&mut self) {
        let Some(time) = self.motion else {
            // Does not move, but keeps looking at its queue without taking anything.
            return;
        };
        while self.motion_at <= self.now {
            self.motion_at += time.max(Duration::from_micros(10));
            let Some(job) = self.robot.execute(self.now, false) else {
                self.motion_at = self.motion_at.max(self.now + 5 * MS);
                return;
            };
            self.executed.push(job);
        }
    }

    pub fn robot_pass(&mut self) {
        self.robot.report(self.now);
        while let Some(delivery) = self.link.receive(End::A, self.now) {
            match delivery {
                Delivery::Bytes(bytes) => self.robot.handle_input(self.now, &bytes),
                Delivery::Closed => self.robot.handle_disconnected(self.now),
            }
        }
        self.robot.handle_timeout(self.now);
        while let Some(event) = self.robot.poll_event() {
            self.robot_events.push(event);
            match event {
                RobotEvent::Connect if self.reachable => {
                    self.link.reconnect();
                    self.pc.handle_disconnected(self.now);
                    self.pc.handle_connected(self.now);
                    self.robot.handle_connected(self.now);
                }
                RobotEvent::Connect => self.robot.handle_disconnected(self.now),
                RobotEvent::Disconnect => {
                    self.link.disconnect(self.now);
                    self.robot.handle_disconnected(self.now);
                }
                _ => {}
            }
        }
        let mut out = [0; 4096];
        while let Some(length) = self.robot.poll_transmit(self.now, &mut out) {
            self.from_robot.push(out[..length].to_vec());
            self.link.send(End::A, self.now, &out[..length]);
        }
    }

    pub fn pc_pass(&mut self) {
        while let Some(delivery) = self.link.receive(End::B, self.now) {
            match delivery {
                Delivery::Bytes(bytes) => self.pc.handle_input(self.now, &bytes),
                Delivery::Closed => self.pc.handle_disconnected(self.now),
            }
        }
        self.pc.handle_timeout(self.now);
        while let Some(event) = self.pc.poll_event() {
            self.pc_events.push(event);
            if event == PcEvent::Disconnect {
                self.link.disconnect(self.now);
                self.pc.handle_disconnected(self.now);
            }
        }
        let mut out = [0; 4096];
        while let Some(length) = self.pc.poll_transmit(self.now, &mut out) {
            self.from_pc.push(out[..length].to_vec());
            self.link.send(End::B, self.now, &out[..length]);
        }
    }

    /// Returns the executed lines, in sequence.
    pub fn lines(&self) -> Vec<Line> {
        self.executed.iter().map(|job| job.work).collect()
    }

    pub fn is_over(&self) -> bool {
        self.pc_events
            .iter()
            .any(|event| matches!(event, PcEvent::OrderOver { .. } | PcEvent::OutcomeUnknown { .. }))
    }
}

/// Restarts the robot's controller, which loses its memory.
pub fn restart<C: Controller>(rig: &mut Rig<C>, capacity: usize) {
    rig.link.disconnect(rig.now);
    rig.robot = C::begin(RobotConfig::tcp(), capacity, 1);
}
