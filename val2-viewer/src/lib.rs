#![cfg_attr(any(not(doctest), feature = "tokio"), doc = include_str!("../README.md"))]
#![no_std]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

#[cfg(feature = "arbitrary")]
extern crate std;

mod decoder;
mod error;
mod flow;
pub mod host;
mod message;
#[cfg(feature = "spec")]
mod spec;
pub mod timing;
#[cfg(feature = "tokio")]
pub mod tokio;
pub mod workstation;

pub use robot_session;

pub use decoder::Decoder;
pub use error::{ConfigError, DecodeError, EncodeError};
pub use flow::{Flow, XOFF, XON};
pub use host::{Format, Host, HostConfig, HostEvent, HostStatistics};
pub use message::{ENQ, PosePacket};
pub use workstation::{Workstation, WorkstationConfig, WorkstationEvent, WorkstationStatistics};
