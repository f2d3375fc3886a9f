#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(any(test, feature = "tokio"))]
extern crate std;

#[cfg(feature = "tokio")]
mod codec;
pub mod controller;
mod decoder;
pub mod device;
mod dialect;
mod error;
mod fields;
mod format;
mod frame;
mod message;
mod outgoing;
mod pose;
#[cfg(feature = "serde")]
mod serde_impls;
pub mod state;
pub mod task;
mod units;

#[cfg(feature = "tokio")]
pub use codec::{ControllerCodec, DeviceCodec};
pub use controller::Controller;
pub use decoder::Decoder;
pub use device::Device;
pub use dialect::Dialect;
pub use error::{DecodeError, EncodeError, Expected, SessionError};
pub use frame::Line;
pub use message::{BLOW, Command, ErrorCode, Mode, Reply, Status, VACUUM};
pub use pose::{AnyPose, NoPose, PlatformPose, Pose, RobotPose};
pub use units::{Angle, Length};

/// The TCP ports on which the devices listen; the controller connects to all three and keeps them open for the whole task
/// (§2).
pub mod port {
    /// The robot controller (RC), at 192.168.0.1 in the source's cell.
    pub const ROBOT: u16 = 2001;
    /// The controller of the orientation platform (OPC), at 192.168.0.2.
    pub const PLATFORM: u16 = 2002;
    /// The controller of the conditioning system (CSC), at 192.168.0.3.
    pub const CONDITIONING: u16 = 2003;
}
