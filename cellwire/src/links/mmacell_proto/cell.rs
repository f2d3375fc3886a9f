//! The simulated cell: three devices and the parts between them.

use std::time::Duration;

use mmacell_proto::{Dialect, PlatformPose, RobotPose, task};

use super::periphery::Periphery;
use super::station::Station;
use super::workpiece::Workpieces;

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

    /// The devices of the task behind this connection.
    pub fn devices(self) -> &'static [task::Device] {
        match self {
            Self::Robot => &[task::Device::Robot],
            Self::Platform => &[task::Device::Platform],
            Self::Periphery => &[task::Device::Conditioning, task::Device::Vision, task::Device::Gripper],
        }
    }
}

impl Cell {
    /// A cell whose parts follow from `seed`; with `errors`, one motion of the robot in a hundred fails.
    pub fn new(seed: u64, errors: bool) -> Self {
        let config = super::central::CONFIG;
        Self {
            robot: Station::new(config.robot_home, Dialect::STRICT),
            platform: Station::new(config.platform_home, Dialect::STRICT),
            periphery: Periphery::default(),
            parts: Workpieces::new(seed),
            errors: errors.then(|| fastrand::Rng::with_seed(!seed)),
            motions_seen: 0,
        }
    }

    /// A new connection to a device.
    pub fn connect(&mut self, which: Which) {
        match which {
            Which::Robot => self.robot.connect(),
            Which::Platform => self.platform.connect(),
            Which::Periphery => self.periphery.connect(),
        }
    }

    /// A device hears bytes; what it says, and whether it closes the connection then.
    pub fn hear(&mut self, which: Which, now: Duration, bytes: &[u8]) -> (Vec<u8>, bool) {
        self.advance(now);
        match which {
            Which::Robot => {
                let heard = self.robot.hear(now, bytes);
                self.break_down();
                self.advance(now);
                (heard.replies, heard.closed)
            }
            Which::Platform => {
                let heard = self.platform.hear(now, bytes);
                (heard.replies, heard.closed)
            }
            Which::Periphery => {
                let heard = self.periphery.hear(bytes);
                for (valve, open) in heard.valves {
                    self.parts.set_valve(now, valve, open, self.robot.pose());
                }
                (heard.replies, heard.closed)
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

    /// The robot.
    pub fn robot(&self) -> &Station<RobotPose> {
        &self.robot
    }

    /// The platform.
    pub fn platform(&self) -> &Station<PlatformPose> {
        &self.platform
    }

    /// Now and then the motion that has just begun is going to fail.
    fn break_down(&mut self) {
        if self.robot.motions() > core::mem::replace(&mut self.motions_seen, self.robot.motions())
            && let Some(rng) = &mut self.errors
            && rng.u32(..100) == 0
        {
            self.robot.fail_motion();
        }
    }
}
