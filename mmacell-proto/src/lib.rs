//! The MM&A micro-manipulation cell
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod controller;
mod decoder;
pub mod device;
mod dialect;
mod error;
mod fields;
mod frame;
mod message;
mod outgoing;
mod pose;
#[cfg(feature = "serde")]
mod serde_impls;
pub mod state;
pub mod task;
mod units;

pub use controller::Controller;
pub use decoder::Decoder;
pub use device::Device;
pub use dialect::Dialect;
pub use error::{DecodeError, EncodeError, Expected, SessionError};
pub use frame::Line;
pub use message::{BLOW, Command, ErrorCode, Mode, Reply, Status, VACUUM};
pub use pose::{AnyPose, NoPose, PlatformPose, Pose, RobotPose};
pub use units::{Angle, Length};
