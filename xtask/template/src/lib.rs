#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "arbitrary")]
extern crate std;

mod decoder;
pub mod device;
mod error;
pub mod host;
mod message;
#[cfg(feature = "spec")]
mod spec;

pub use robot_session;

pub use decoder::Decoder;
pub use device::{Device, DeviceConfig, DeviceEvent, DeviceStatistics};
pub use error::{ConfigError, DecodeError, EncodeError, SessionError};
pub use host::{Host, HostConfig, HostEvent, HostStatistics};
pub use message::Message;
