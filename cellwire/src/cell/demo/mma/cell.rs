//! The simulated cell: three devices and the parts between them.

use std::time::Duration;

use anyhow::Result;
use mmacell_proto::{DeviceConfig, PlatformPose, RobotPose};
use mmacell_task::{Device, TaskConfig};

use super::periphery::Periphery;
use super::workpiece::{Record, Workpieces};
use crate::links::mmacell_proto::axes::{PLATFORM_HOME, ROBOT_HOME};
use crate::links::mmacell_proto::station::{Fate, MotionFaults, Station};

/// The set-up of the simulated cell. Its times are those of the cell.
pub const CONFIG: TaskConfig = TaskConfig {
    robot_home: ROBOT_HOME,
    platform_home: PLATFORM_HOME,
    camera_1: Some(RobotPose::from_units([-120_000, 0, 60_000, 0])),
    camera_2: Some(RobotPose::from_units([120_000, 0, 60_000, 0])),
    percent: 80,
    ..TaskConfig::DEFAULT
};

/// The connections of the central controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Which {
    /// To the robot.
    Robot,
    /// To the platform.
    Platform,
    /// To the third device, which has the cameras' trigger and the valves.
    Periphery,
}

/// Robot, platform, cameras and valves, and what they work on.
#[derive(Debug)]
pub struct Cell {
    robot: Station<RobotPose>,
    platform: Station<PlatformPose>,
    periphery: Periphery,
    parts: Workpieces,
    errors: Option<fastrand::Rng>,
    motions_seen: u64,
}

impl Which {
    /// All three.
    pub const ALL: [Self; 3] = [Self::Robot, Self::Platform, Self::Periphery];

    /// The devices of the task at the other end of this connection.
    pub fn devices(self) -> &'static [Device] {
        match self {
            Self::Robot => &[Device::Robot],
            Self::Platform => &[Device::Platform],
            Self::Periphery => &[Device::Conditioning, Device::Vision, Device::Gripper],
        }
    }
}

impl Cell {
    /// A cell whose parts follow from `seed`; with `errors`, one motion of the robot in a hundred fails, and one stalls.
    ///
    /// # Errors
    /// Never, with the defaults of the protocol.
    pub fn new(seed: u64, errors: bool, robot: MotionFaults) -> Result<Self> {
        let config = CONFIG;
        let device = DeviceConfig::DEFAULT;
        Ok(Self {
            robot: Station::new(config.robot_home, device, robot)?,
            platform: Station::new(config.platform_home, device, MotionFaults::default())?,
            periphery: Periphery::new()?,
            parts: Workpieces::new(seed),
            errors: errors.then(|| fastrand::Rng::with_seed(!seed)),
            motions_seen: 0,
        })
    }

    /// A new connection to a device takes the place of the one before.
    pub fn connect(&mut self, which: Which, now: Duration) {
        match which {
            Which::Robot => self.robot.connect(now),
            Which::Platform => self.platform.connect(now),
            Which::Periphery => self.periphery.connect(now),
        }
    }

    /// Bytes arrive at a device; what it replies, and whether it closes the connection then.
    pub fn receive(&mut self, which: Which, now: Duration, bytes: &[u8]) -> (Vec<u8>, bool) {
        self.advance(now);
        match which {
            Which::Robot => {
                let answer = self.robot.receive(now, bytes);
                self.break_down();
                self.advance(now);
                (answer.replies, answer.closed)
            }
            Which::Platform => {
                let answer = self.platform.receive(now, bytes);
                (answer.replies, answer.closed)
            }
            Which::Periphery => {
                let answer = self.periphery.receive(now, bytes);
                for (valve, open) in answer.valves {
                    self.parts.set_valve(now, valve, open, self.robot.pose());
                }
                (answer.replies, answer.closed)
            }
        }
    }

    /// Moves on to this time.
    pub fn advance(&mut self, now: Duration) {
        self.robot.advance(now);
        self.platform.advance(now);
        self.parts.move_to(now, self.robot.pose());
    }

    /// The parts.
    pub fn parts(&self) -> &Workpieces {
        &self.parts
    }

    /// What happened to the parts, for a judge who forgets it.
    pub fn record_mut(&mut self) -> &mut Record {
        &mut self.parts.record
    }

    #[cfg(test)]
    pub(super) fn drop_part(&mut self, at: Duration) {
        self.parts.record.outcomes.push((at, super::workpiece::Outcome::Dropped));
    }

    /// The robot.
    pub fn robot(&self) -> &Station<RobotPose> {
        &self.robot
    }

    /// The platform.
    pub fn platform(&self) -> &Station<PlatformPose> {
        &self.platform
    }

    /// Now and then the motion that has just begun is going to fail, or to stall.
    fn break_down(&mut self) {
        if self.robot.motions() > core::mem::replace(&mut self.motions_seen, self.robot.motions())
            && let Some(rng) = &mut self.errors
        {
            match rng.u32(..100) {
                0 => self.robot.end_motion(Fate::Fails),
                1 => self.robot.end_motion(Fate::Stalls),
                _ => {}
            }
        }
    }
}
