use core::fmt;

use mmacell_proto::{
    CentralEvent, CloseReason, ErrorCode, MissReason, PlatformPose, Pose, Progress, RobotPose,
};

use crate::output::Device;
use crate::step::Step;

/// An event in the cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Event {
    /// The device is connected and ready. Only robot, platform and conditioning system are waited for.
    Ready(Device),
    /// The device has carried out its order, or has begun to.
    Done(Device),
    /// The robot or the platform has answered a [`Command::Status`](mmacell_proto::Command::Status).
    Status {
        /// The robot or the platform.
        device: Device,
        /// The conclusion for the motion that was ordered last.
        motion: Progress,
    },
    /// The device will not carry out its order, or cannot.
    Failed {
        /// The device that failed.
        device: Device,
        /// The way in which the device failed.
        failure: Failure,
    },
    /// Camera 1 sees a part.
    PartFound {
        /// The pose of the platform that turns its place towards the gripper.
        platform: PlatformPose,
        /// The pose in which the robot takes it.
        pick: RobotPose,
    },
    /// Camera 2 sees the place.
    SlotFound {
        /// The pose in which the robot puts the part.
        place: RobotPose,
    },
    /// The camera sees neither a part nor a place.
    NotFound,
    /// The level of the vacuum switch. It is taken for low until this reports otherwise; the task acts on its edges.
    Switch {
        /// Whether the vacuum is deep enough for a part to be on the gripper.
        high: bool,
    },
    /// Stops everything now, from any step: [`Step::Faulted`] follows. A command that a session has in flight is answered
    /// first, or its session's `abort` is called.
    Abort,
    /// After [`Step::Placed`], [`Step::Unpicked`] or [`Step::NothingFound`]: the next part. This and the next two wait until they
    /// can be followed; the last one counts.
    Next,
    /// After [`Step::Placed`], [`Step::Unpicked`], [`Step::NothingFound`] or [`Step::Faulted`]: close the connections. After
    /// a fault only when the devices that are there have confirmed the stop, and report that they are at rest: the caller
    /// limits that wait.
    Finish,
    /// After [`Step::Faulted`], as soon as all devices are ready: reset, and on from step 3.
    Recover,
}

/// The way in which a device failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Failure {
    /// The device refused an order.
    Refused(ErrorCode),
    /// The status of the device shows an error.
    Error(ErrorCode),
    /// The motion has ended, and the device has not arrived.
    Missed(MissReason),
    /// The order was aborted before it was sent.
    Aborted,
    /// The connection is gone; the device has to become ready again.
    Lost,
}

/// The fault that led to [`Step::Faulted`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Fault {
    /// A device failed during a step.
    Device {
        /// The device that failed.
        device: Device,
        /// The way in which the device failed.
        failure: Failure,
    },
    /// A step took longer than it may.
    Timeout {
        /// The step that took too long.
        step: Step,
    },
    /// The vacuum switch is high although the gripper must be empty: before the vacuum is on, or after the part was blown
    /// off.
    SwitchHigh {
        /// The step in which the gripper must be empty.
        step: Step,
    },
    /// The caller aborted the task with [`Event::Abort`].
    Aborted,
}

impl Event {
    /// Returns the task's event for an event at the central controller's end of this device's connection.
    pub fn from_central<P: Pose>(device: Device, event: &CentralEvent<P>) -> Option<Self> {
        let failed = |failure| Some(Self::Failed { device, failure });
        match *event {
            CentralEvent::Done { .. } | CentralEvent::Closed { reason: CloseReason::Agreed, .. } => {
                Some(Self::Done(device))
            }
            CentralEvent::Refused { error, .. } => failed(Failure::Refused(error)),
            CentralEvent::Status { status, .. } if status.error != ErrorCode::None => {
                failed(Failure::Error(status.error))
            }
            CentralEvent::Status { motion, .. } => Some(Self::Status { device, motion }),
            CentralEvent::Aborted { .. } => failed(Failure::Aborted),
            CentralEvent::Closed { .. } => failed(Failure::Lost),
            _ => None,
        }
    }
}

/// Follows the name of the device.
impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused(error) => write!(f, "has refused an order ({error})"),
            Self::Error(error) => write!(f, "reports an error ({error})"),
            Self::Missed(miss) => write!(f, "has not arrived: {miss}"),
            Self::Aborted => f.write_str("has not received its order, which was aborted"),
            Self::Lost => f.write_str("is not connected any more"),
        }
    }
}

impl Failure {
    /// Returns whether a device with axes may still execute an earlier motion.
    const fn may_move(self) -> bool {
        !matches!(self, Self::Missed(_))
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Device { device, failure } => {
                let moves = matches!(device, Device::Robot | Device::Platform) && failure.may_move();
                let rest = if moves { ": it may still be moving" } else { "" };
                write!(f, "the {device} {failure}{rest}")
            }
            Self::Timeout { step } => write!(f, "the step `{step}` took too long"),
            Self::SwitchHigh { step } => {
                write!(
                    f,
                    "the vacuum switch is high in the step `{step}`, in which no part can be on the gripper"
                )
            }
            Self::Aborted => f.write_str("the task was aborted"),
        }
    }
}
