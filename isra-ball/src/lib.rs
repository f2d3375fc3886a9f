#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "tokio")]
extern crate std;

mod ball;
#[cfg(feature = "tokio")]
mod codec;
mod decoder;
mod error;
mod filter;
mod frame;
mod host;
mod keys;
mod message;
mod queue;
pub mod state;
pub mod timing;

pub use ball::{Ball, BallEvent};
#[cfg(feature = "tokio")]
pub use codec::Codec;
pub use decoder::Decoder;
pub use error::{DecodeError, EncodeError, SessionError};
pub use filter::{Axes, Filter};
pub use frame::{ENQ, Frame};
pub use host::{Config, Host, HostEvent};
pub use keys::{Edges, KeyEdges, Keys};
pub use message::{Packet, Status};
