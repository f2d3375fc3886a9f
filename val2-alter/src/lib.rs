#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "tokio")]
extern crate std;

mod clamp;
#[cfg(feature = "tokio")]
mod codec;
mod controller;
mod decoder;
mod error;
mod frame;
mod host;
mod limit;
mod message;
mod pose;
mod queue;
mod scale;
pub mod state;
pub mod timing;
mod transform;
pub mod viewer;

pub use clamp::Clamp;
#[cfg(feature = "tokio")]
pub use codec::Codec;
pub use controller::{Controller, ControllerConfig, ControllerEvent, ControllerStats};
pub use decoder::{Decoder, Received};
pub use error::{DecodeError, EncodeError, SessionError};
pub use frame::{DLE, ETX, Frame, Framing, LeadingDle, STX};
pub use host::{Host, HostConfig, HostEvent, HostStats, Policy, Select, Unselected};
pub use limit::{Limiter, Limits};
pub use message::*;
pub use pose::Pose;
pub use scale::Scale;
pub use state::{ControllerState, HostState};
pub use transform::{Layout, Order, Transform};
