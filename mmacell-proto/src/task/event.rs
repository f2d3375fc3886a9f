use super::Step;
use crate::state::Motion;
use crate::{Command, ErrorCode, NoPose, PlatformPose, Pose, RobotPose, controller};

/// Who takes orders.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Device {
    /// The robot (RC).
    Robot,
    /// The orientation platform (OPC).
    Platform,
    /// The conditioning system (CSC). It has to be there; the source gives it no orders but to close.
    Conditioning,
    /// The cameras, whether the central controller's own or behind a connection.
    Vision,
    /// The valves of the gripper, whether the central controller's own or behind a connection.
    Gripper,
}

/// What the task is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event {
    /// The device is connected and ready. Only robot, platform and conditioning system are waited for.
    Ready(Device),
    /// The device has carried out its order, or has begun to.
    Done(Device),
    /// The robot or the platform has answered a [`Command::Status`].
    Status {
        /// Which.
        device: Device,
        /// Whether it moves, as the controller believes.
        moving: bool,
    },
    /// The device will not carry out its order, or cannot.
    Failed {
        /// Which.
        device: Device,
        /// How.
        failure: Failure,
    },
    /// Camera 1 sees a part.
    PartFound {
        /// The pose of the platform that turns its place towards the gripper.
        platform: PlatformPose,
        /// Where the robot takes it.
        pick: RobotPose,
    },
    /// Camera 2 sees the place.
    SlotFound {
        /// Where the robot puts the part.
        place: RobotPose,
    },
    /// The camera sees nothing.
    NotFound,
    /// The level of the vacuum switch. It is taken for low until told otherwise.
    Switch {
        /// High: the vacuum is deep enough for a part to be on the gripper.
        high: bool,
    },
    /// After [`Step::Placed`] or [`Step::NothingFound`]: the next part. This and the next two wait until they can be followed;
    /// the last one told counts.
    Next,
    /// After [`Step::Placed`], [`Step::NothingFound`] or [`Step::Faulted`]: close the connections.
    Finish,
    /// After [`Step::Faulted`], as soon as all devices are ready: reset, and on from step 3.
    Recover,
}

/// How a device failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Failure {
    /// It refused an order.
    Refused(ErrorCode),
    /// Its status shows an error.
    Error(ErrorCode),
    /// Its connection is gone; it has to become ready again.
    Lost,
}

/// What the task wants done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
    /// Take a picture, then tell what is in it: [`Event::PartFound`], [`Event::SlotFound`] or [`Event::NotFound`].
    Acquire {
        /// 1 or 2.
        camera: i32,
    },
    /// Set a valve, then tell [`Event::Done`].
    Grip {
        /// [`VACUUM`](crate::VACUUM) or [`BLOW`](crate::BLOW).
        gripper: i32,
        /// On.
        open: bool,
    },
}

impl Event {
    /// What an event at the controller's end of this device's connection means to the task.
    pub fn from_controller<P: Pose>(device: Device, event: &controller::Event<P>) -> Option<Self> {
        Some(match *event {
            controller::Event::Done { .. } => Self::Done(device),
            controller::Event::Refused { error, .. } => {
                Self::Failed { device, failure: Failure::Refused(error) }
            }
            controller::Event::Status { status, .. } if status.error != ErrorCode::None => {
                Self::Failed { device, failure: Failure::Error(status.error) }
            }
            controller::Event::Status { motion, .. } => {
                Self::Status { device, moving: motion != Motion::Still }
            }
            controller::Event::Closed { reason: controller::Closing::Agreed, .. } => return None,
            controller::Event::Closed { .. } => Self::Failed { device, failure: Failure::Lost },
        })
    }
}
