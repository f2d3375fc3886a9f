#![cfg_attr(any(not(doctest), feature = "tokio"), doc = include_str!("../README.md"))]
#![no_std]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

#[cfg(any(feature = "arbitrary", feature = "tokio"))]
extern crate std;

pub mod controller;
mod decoder;
mod error;
mod frame;
mod framing;
pub mod host;
mod limit;
mod message;
mod scale;
#[cfg(feature = "spec")]
mod spec;
pub mod timing;
#[cfg(feature = "tokio")]
pub mod tokio;

pub use controller::{
    Controller, ControllerConfig, ControllerEvent, ControllerState, ControllerStatistics, Unselected,
};
pub use decoder::{Decoder, ReceivedMessage};
pub use error::{ConfigError, DecodeError, EncodeError, SessionError};
pub use frame::Frame;
pub use framing::{DLE, ETX, Framing, LeadingDle, LeadingDleError, STX};
pub use host::{
    ExceptionOutcome, Host, HostConfig, HostEvent, HostState, HostStatistics, LostReason, Policy,
    UnknownReason,
};
pub use limit::{Limiter, Limits, Reach};
pub use message::*;
pub use robot_session;
pub use scale::Scale;
