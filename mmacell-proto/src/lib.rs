#![cfg_attr(any(not(doctest), feature = "tokio"), doc = include_str!("../README.md"))]
#![no_std]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

#[cfg(any(test, feature = "arbitrary", feature = "tokio"))]
extern crate std;

#[cfg(feature = "arbitrary")]
mod arbitrary;
pub mod central;
mod decoder;
pub mod device;
mod dialect;
mod error;
mod fields;
mod format;
mod frame;
mod message;
mod pose;
#[cfg(feature = "serde")]
mod serde_impls;
#[cfg(feature = "spec")]
mod spec;
#[cfg(feature = "tokio")]
pub mod tokio;
mod units;

pub use central::{
    Central, CentralConfig, CentralEvent, CentralStatistics, CloseReason, MissReason, Progress, Unfinished,
};
pub use decoder::{Decoder, LineDecoder};
pub use device::{Device, DeviceClosing, DeviceConfig, DeviceEvent, DeviceStatistics, Order, Rejection};
pub use dialect::Dialect;
pub use error::{ConfigError, DecodeError, EncodeError, Expected, SessionError};
pub use frame::Line;
pub use message::{BLOW, Command, ErrorCode, InDialect, Mode, Reply, Status, VACUUM};
pub use pose::{AnyPose, NoPose, PlatformPose, Pose, RobotPose};
pub use robot_session;
pub use units::{Angle, Length};

/// The TCP ports on which the devices listen; the central controller connects to all three and keeps them open for the whole task
/// (§2).
pub mod port {
    /// The robot controller (RC), at 192.168.0.1 in the source's cell.
    pub const ROBOT: u16 = 2001;
    /// The controller of the orientation platform (OPC), at 192.168.0.2.
    pub const PLATFORM: u16 = 2002;
    /// The controller of the conditioning system (CSC), at 192.168.0.3.
    pub const CONDITIONING: u16 = 2003;
}
