//! The simulated cell: a robot that its port shares with the periphery, and the parts that they handle.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use mmacell_proto::{PlatformPose, RobotPose};
use mmacell_task::TaskConfig;
use robot_session::{Session, now};

use super::workpiece::Workpieces;
use crate::run::mma::{Periphery, PeripheryEvent};
use cellwire_sim::Simulator;
use cellwire_sim::host::{HostedSession, Request};
use cellwire_sim::mma::{MmaDevice, Simulated as _};

/// The set-up of the simulated cell. Its times are those of the cell.
pub const CONFIG: TaskConfig = TaskConfig {
    robot_home: RobotPose::HOME,
    platform_home: PlatformPose::HOME,
    camera_1: Some(RobotPose::from_units([-120_000, 0, 60_000, 0])),
    camera_2: Some(RobotPose::from_units([120_000, 0, 60_000, 0])),
    percent: 80,
    ..TaskConfig::DEFAULT
};

/// The interval at which the vacuum switch is looked at.
const SWITCH_CHECK_INTERVAL: Duration = Duration::from_millis(1);

/// A robot, which a host runs and the periphery sees.
#[derive(Debug, Clone)]
pub struct SharedRobot(Arc<Mutex<Simulator<MmaDevice<RobotPose>>>>);

impl SharedRobot {
    /// Creates a robot without a host.
    pub fn new(robot: Simulator<MmaDevice<RobotPose>>) -> Self {
        Self(Arc::new(Mutex::new(robot)))
    }

    fn lock(&self) -> MutexGuard<'_, Simulator<MmaDevice<RobotPose>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the pose at this time.
    fn pose(&self, now: Duration) -> RobotPose {
        let mut robot = self.lock();
        robot.handle_timeout(now);
        robot.device().pose()
    }
}

impl HostedSession for SharedRobot {
    fn request(event: &Self::Event) -> Option<Request> {
        Simulator::<MmaDevice<RobotPose>>::request(event)
    }
}

impl Session for SharedRobot {
    type Event = <Simulator<MmaDevice<RobotPose>> as Session>::Event;
    type Statistics = <Simulator<MmaDevice<RobotPose>> as Session>::Statistics;
    const MAX_INPUT: usize = Simulator::<MmaDevice<RobotPose>>::MAX_INPUT;
    const MAX_TRANSMIT: usize = Simulator::<MmaDevice<RobotPose>>::MAX_TRANSMIT;

    fn handle_connected(&mut self, now: Duration) {
        self.lock().handle_connected(now);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.lock().handle_disconnected(now);
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        self.lock().handle_input(now, bytes);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.lock().handle_timeout(now);
    }

    fn wants_input(&self) -> bool {
        self.lock().wants_input()
    }

    fn poll_event(&mut self) -> Option<Self::Event> {
        self.lock().poll_event()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        self.lock().poll_transmit(now, out)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.lock().poll_timeout()
    }

    fn statistics(&self) -> Self::Statistics {
        self.lock().statistics()
    }
}

/// Cameras, valves and vacuum switch, and the parts that the robot handles.
#[derive(Debug)]
pub struct Cell {
    robot: SharedRobot,
    /// The clock of the cell is faster than the clock of the host by this factor.
    speed: u32,
    switch: bool,
    events: VecDeque<PeripheryEvent>,
    /// The part that the client has begun last, by its number; `None` before the first.
    pub part: Option<usize>,
    /// The parts that were put in their place, by the client's numbers, in sequence.
    pub placed: Vec<usize>,
    /// The parts as they are.
    pub parts: Workpieces,
}

impl Cell {
    /// Creates a cell whose parts follow from `seed`.
    pub fn new(robot: SharedRobot, speed: u32, seed: u64) -> Self {
        let (switch, events, part, placed) = (false, VecDeque::new(), None, Vec::new());
        Self { robot, speed, switch, events, part, placed, parts: Workpieces::new(seed) }
    }

    /// Returns the time of the cell.
    pub fn now(&self) -> Duration {
        now() * self.speed
    }

    /// Returns the time of the cell, and the pose of the robot.
    fn state(&self) -> (Duration, RobotPose) {
        let now = now();
        (now * self.speed, self.robot.pose(now))
    }
}

/// The client and its operator both see the cell.
impl Periphery for &RefCell<Cell> {
    fn acquire(&mut self, camera: i32, part: usize) {
        let mut cell = self.borrow_mut();
        cell.part = Some(part);
        let event = match camera {
            1 => {
                let (platform, pick) = cell.parts.part();
                PeripheryEvent::Part(platform, pick)
            }
            _ => PeripheryEvent::Slot(cell.parts.place()),
        };
        cell.events.push_back(event);
    }

    fn set_valve(&mut self, valve: i32, open: bool) {
        let mut cell = self.borrow_mut();
        let (now, gripper) = cell.state();
        let before = cell.parts.record.placed;
        cell.parts.set_valve(now, valve, open, gripper);
        if cell.parts.record.placed > before {
            let part = cell.part;
            cell.placed.extend(part);
        }
        cell.events.push_back(PeripheryEvent::ValveSet);
    }

    fn poll(&mut self) -> Option<PeripheryEvent> {
        let mut cell = self.borrow_mut();
        let (now, gripper) = cell.state();
        cell.parts.move_to(now, gripper);
        let high = cell.parts.switch();
        if core::mem::replace(&mut cell.switch, high) != high {
            cell.events.push_back(PeripheryEvent::Switch(high));
        }
        cell.events.pop_front()
    }

    fn due(&self) -> Option<Duration> {
        Some(now() + SWITCH_CHECK_INTERVAL)
    }
}
