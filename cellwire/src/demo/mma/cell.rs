//! The simulated cell: three devices and the parts between them.

use std::time::Duration;

use anyhow::Result;
use mmacell_proto::{DeviceConfig, PlatformPose, RobotPose};
use mmacell_task::{Device, TaskConfig};

use super::periphery::Periphery;
use super::workpiece::Workpieces;
use cellwire_sim::mma::{Mma, MmaDevice, MotionFaults, MotionOutcome, Simulated};
use cellwire_sim::{Settings as _, Simulator, SimulatorReport};
use robot_session::{Session as _, Step, Steps};

/// The set-up of the simulated cell. Its times are those of the cell.
pub const CONFIG: TaskConfig = TaskConfig {
    robot_home: RobotPose::HOME,
    platform_home: PlatformPose::HOME,
    camera_1: Some(RobotPose::from_units([-120_000, 0, 60_000, 0])),
    camera_2: Some(RobotPose::from_units([120_000, 0, 60_000, 0])),
    percent: 80,
    ..TaskConfig::DEFAULT
};

/// The connections of the central controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellConnection {
    /// The connection to the robot.
    Robot,
    /// The connection to the platform.
    Platform,
    /// The connection to the third device, which has the cameras' trigger and the valves.
    Periphery,
}

/// Robot, platform, cameras and valves, and the parts that they handle.
#[derive(Debug)]
pub struct Cell {
    robot: Simulator<MmaDevice<RobotPose>>,
    platform: Simulator<MmaDevice<PlatformPose>>,
    periphery: Periphery,
    parts: Workpieces,
    errors: Option<fastrand::Rng>,
    motions_seen: u64,
}

impl CellConnection {
    /// All three.
    pub const ALL: [Self; 3] = [Self::Robot, Self::Platform, Self::Periphery];

    /// Returns the devices of the task at the other end of this connection.
    pub fn devices(self) -> &'static [Device] {
        match self {
            Self::Robot => &[Device::Robot],
            Self::Platform => &[Device::Platform],
            Self::Periphery => &[Device::Conditioning, Device::Vision, Device::Gripper],
        }
    }
}

impl Cell {
    /// Creates a cell whose parts follow from `seed`, and whose devices are of this kind; with `errors`, one motion of the
    /// robot in a hundred fails, and one stalls.
    ///
    /// # Errors
    /// Never, with the refusal of the protocol.
    pub fn new(seed: u64, errors: bool, robot: MotionFaults, device: DeviceConfig) -> Result<Self> {
        let cell = CONFIG;
        Ok(Self {
            robot: Mma { config: device, home: cell.robot_home, faults: robot, ..Mma::default() }
                .simulator()?
                .keeping_nothing(),
            platform: Mma { config: device, home: cell.platform_home, ..Mma::default() }
                .simulator()?
                .keeping_nothing(),
            periphery: Periphery::new(device)?,
            parts: Workpieces::new(seed),
            errors: errors.then(|| fastrand::Rng::with_seed(!seed)),
            motions_seen: 0,
        })
    }

    /// Connects to a device; a new connection replaces the previous one.
    pub fn connect(&mut self, which: CellConnection, now: Duration) {
        match which {
            CellConnection::Robot => connect(&mut self.robot, now),
            CellConnection::Platform => connect(&mut self.platform, now),
            CellConnection::Periphery => self.periphery.connect(now),
        }
    }

    /// Passes bytes to a device; returns its reply, and whether it then closes the connection.
    pub fn receive(&mut self, which: CellConnection, now: Duration, bytes: &[u8]) -> (Vec<u8>, bool) {
        self.advance(now);
        match which {
            CellConnection::Robot => {
                let answer = receive(&mut self.robot, now, bytes);
                self.break_down();
                self.advance(now);
                answer
            }
            CellConnection::Platform => receive(&mut self.platform, now, bytes),
            CellConnection::Periphery => {
                let answer = self.periphery.receive(now, bytes);
                for (valve, open) in answer.valves {
                    self.parts.set_valve(now, valve, open, self.robot.device().pose());
                }
                (answer.replies, answer.closed)
            }
        }
    }

    /// Moves on to this time.
    pub fn advance(&mut self, now: Duration) {
        advance(&mut self.robot, now);
        advance(&mut self.platform, now);
        self.parts.move_to(now, self.robot.device().pose());
    }

    /// Returns the parts.
    pub fn parts(&self) -> &Workpieces {
        &self.parts
    }

    #[cfg(test)]
    pub(super) fn drop_part(&mut self, at: Duration) {
        self.parts.record.outcomes.push((at, super::workpiece::Outcome::Dropped));
    }

    /// Returns the robot.
    pub fn robot(&self) -> &MmaDevice<RobotPose> {
        self.robot.device()
    }

    /// Returns the platform.
    pub fn platform(&self) -> &MmaDevice<PlatformPose> {
        self.platform.device()
    }

    /// Makes the motion that has just begun fail or stall, at times.
    fn break_down(&mut self) {
        let motions = self.robot.device().motions();
        if motions > core::mem::replace(&mut self.motions_seen, motions)
            && let Some(rng) = &mut self.errors
        {
            match rng.u32(..100) {
                0 => self.robot.device_mut().end_motion(MotionOutcome::Fails),
                1 => self.robot.device_mut().end_motion(MotionOutcome::Stalls),
                _ => {}
            }
        }
    }
}

/// Connects to a device; a new connection replaces the previous one.
fn connect<P: Simulated>(device: &mut Simulator<MmaDevice<P>>, now: Duration) {
    device.handle_disconnected(now);
    device.handle_connected(now);
}

/// Returns the device's reply, and whether it then closes the connection.
fn receive<P: Simulated>(
    device: &mut Simulator<MmaDevice<P>>,
    now: Duration,
    bytes: &[u8],
) -> (Vec<u8>, bool) {
    let (mut replies, mut closed, mut buffer) = (Vec::new(), false, [0; 64]);
    // Every order is decided at once, so that more is wanted after each piece.
    for piece in bytes.chunks(Simulator::<MmaDevice<P>>::MAX_INPUT) {
        device.handle_input(now, piece);
        let mut steps = Steps::NEW;
        loop {
            match steps.next(device, now, &mut buffer) {
                Step::Event(told) => closed |= matches!(told, SimulatorReport::Close(_)),
                Step::Write(bytes) => replies.extend_from_slice(bytes),
                Step::Wait { .. } => break,
            }
        }
    }
    (replies, closed)
}

/// Moves on to this time.
fn advance<P: Simulated>(device: &mut Simulator<MmaDevice<P>>, now: Duration) {
    // At rest nothing happens by itself.
    if !device.device().moves() {
        return;
    }
    device.handle_timeout(now);
    while device.poll_event().is_some() {}
}
