#![cfg_attr(any(not(doctest), feature = "tokio"), doc = include_str!("../README.md"))]
#![no_std]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

#[cfg(feature = "arbitrary")]
extern crate std;

pub mod ball;
mod decoder;
mod envelope;
mod error;
mod frame;
pub mod host;
mod keys;
mod message;
#[cfg(feature = "spec")]
mod spec;
pub mod timing;
#[cfg(feature = "tokio")]
pub mod tokio;

pub use robot_session;

pub use ball::{Ball, BallConfig, BallEvent, BallStatistics};
pub use decoder::Decoder;
pub use envelope::ENQ;
pub use error::{ConfigError, DecodeError, EncodeError};
pub use frame::Frame;
pub use host::{Host, HostConfig, HostEvent, HostStatistics};
pub use keys::Keys;
pub use message::{Packet, Status};
