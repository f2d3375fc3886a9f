//! The simulated cell: cameras, valves, and the parts that the robot handles.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use mmacell_proto::{PlatformPose, RobotPose};
use mmacell_task::TaskConfig;
use robot_session::now;

use super::workpiece::Workpieces;
use crate::run::mma::{Periphery, PeripheryEvent};
use cellwire_sim::mma::Simulated as _;

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

/// Cameras, valves and vacuum switch, and the parts that the robot handles.
#[derive(Debug)]
pub struct Cell {
    /// The pose of the robot in its last message.
    gripper: RobotPose,
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
    pub fn new(speed: u32, seed: u64) -> Self {
        let (gripper, switch, events, part) = (CONFIG.robot_home, false, VecDeque::new(), None);
        Self { gripper, speed, switch, events, part, placed: Vec::new(), parts: Workpieces::new(seed) }
    }

    /// Returns the time of the cell.
    pub fn now(&self) -> Duration {
        now() * self.speed
    }

    /// Called when the robot is at this pose.
    pub fn move_to(&mut self, gripper: RobotPose) {
        self.gripper = gripper;
        self.parts.move_to(self.now(), gripper);
    }
}

/// Locks the cell.
pub fn lock(cell: &Mutex<Cell>) -> MutexGuard<'_, Cell> {
    cell.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The client, its operator and the port of the robot share the cell.
impl Periphery for &Mutex<Cell> {
    fn acquire(&mut self, camera: i32, part: usize) {
        let mut cell = lock(self);
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
        let mut cell = lock(self);
        let (now, gripper, part) = (cell.now(), cell.gripper, cell.part);
        let is_placed = cell.parts.set_valve(now, valve, open, gripper);
        cell.placed.extend(part.filter(|_| is_placed));
        cell.events.push_back(PeripheryEvent::ValveSet);
    }

    fn poll(&mut self) -> Option<PeripheryEvent> {
        let mut cell = lock(self);
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
