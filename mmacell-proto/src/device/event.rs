use robot_session::Unexpected;

use crate::error::DecodeError;

/// An event at the device's end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "event", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum DeviceEvent<P> {
    /// The central controller orders this. Answer with [`Device::accept`](crate::Device::accept), and carry it out only if that
    /// succeeds, or with [`Device::refuse`](crate::Device::refuse).
    Asked {
        /// The order to accept or refuse.
        order: Order<P>,
    },
    /// The connection has ended: close it.
    Closed {
        /// The reason that the connection has ended.
        reason: DeviceClosing,
    },
    /// A notice: a command was refused by the protocol itself.
    Rejected {
        /// The reason that the command was refused.
        reason: Rejection,
    },
    /// A notice: an input that the machine did not expect. It has no effect.
    Unexpected(Unexpected),
}

/// An order for a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "order", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Order<P> {
    /// Switch the servo motors; off stops the motion too.
    Servo {
        /// Whether the motors are switched on.
        on: bool,
    },
    /// Go at this speed from now on.
    Override {
        /// The speed of all motions, 0 to 100 %.
        percent: u8,
    },
    /// Go to a pose, then call [`Device::arrived`](crate::Device::arrived). A relative motion has been added up.
    Move {
        /// The pose to go to.
        target: P,
    },
    /// Stop the motion, then call [`Device::arrived`](crate::Device::arrived).
    Stop,
    /// Clear the error, switch the servo motors on, leave any other motion, go home, then call
    /// [`Device::arrived`](crate::Device::arrived).
    Home,
    /// Agree to the end of the connection.
    Close,
    /// Take a picture with a camera.
    Acquire {
        /// The number of the camera, 16 bits on the wire.
        camera: i32,
    },
    /// Open or close a gripper.
    Grip {
        /// The number of the gripper: [`VACUUM`](crate::VACUUM), [`BLOW`](crate::BLOW) or another; 16 bits on the wire.
        gripper: i32,
        /// Whether the gripper is opened: for [`VACUUM`](crate::VACUUM) and [`BLOW`](crate::BLOW) this turns the air on.
        open: bool,
    },
}

/// The reason that a connection has ended at the device's end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum DeviceClosing {
    /// The central controller has closed it; the reply has been sent.
    Agreed,
    /// The central controller does not wait for replies, and more commands have arrived than can be kept.
    Overrun,
}

/// The reason that the protocol itself refuses a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Rejection {
    /// The line cannot be read.
    #[error(transparent)]
    Malformed(#[from] DecodeError),
    /// The command is not possible in this state.
    #[error("not possible in the state {state}")]
    NotNow {
        /// The state of the axes.
        state: &'static str,
    },
    /// A relative motion that leads out of the range of a coordinate.
    #[error("the motion leads out of range")]
    OutOfRange,
    /// The device's pose is not known, or has no form on the wire.
    #[error("the pose of the axes is not known")]
    NoPose,
}
