use core::fmt;

use mmacell_proto::{Command, NoPose, PlatformPose, RobotPose};

use crate::step::Step;

/// A receiver of orders.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Device {
    /// The robot (RC).
    Robot,
    /// The orientation platform (OPC).
    Platform,
    /// The conditioning system (CSC). It must be there; the source gives it no orders but to close.
    Conditioning,
    /// The cameras, whether the central controller's own or at the end of a connection.
    Vision,
    /// The valves of the gripper, whether the central controller's own or at the end of a connection.
    Gripper,
}

impl fmt::Display for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Robot => "robot",
            Self::Platform => "platform",
            Self::Conditioning => "conditioning system",
            Self::Vision => "vision system",
            Self::Gripper => "gripper",
        })
    }
}

/// An action for the task's caller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Output {
    /// Nothing: the task has entered this step.
    Entered(Step),
    /// Send this to the robot.
    Robot(Command<RobotPose>),
    /// Send this to the platform.
    Platform(Command<PlatformPose>),
    /// Send this to the conditioning system.
    Conditioning(Command<NoPose>),
    /// Take a picture, then report its contents: [`Event::PartFound`](crate::Event::PartFound),
    /// [`Event::SlotFound`](crate::Event::SlotFound) or [`Event::NotFound`](crate::Event::NotFound).
    Acquire {
        /// The number of the camera: 1 sees the part, 2 sees the place.
        camera: i32,
    },
    /// Set a valve, then report [`Event::Done`](crate::Event::Done).
    Grip {
        /// The number of the valve: [`VACUUM`](mmacell_proto::VACUUM) or [`BLOW`](mmacell_proto::BLOW).
        gripper: i32,
        /// Whether the valve is opened.
        open: bool,
    },
}
