#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "tokio")]
extern crate std;

#[cfg(feature = "tokio")]
pub mod codec;
pub mod controller;
pub mod decoder;
pub mod error;
pub mod frame;
pub mod host;
pub mod instruction;
#[cfg(feature = "serde")]
mod json;
pub mod message;
pub mod profile;
pub mod state;
pub mod timing;

#[cfg(feature = "tokio")]
pub use codec::{Codec, OwnedFrame};
pub use controller::{Controller, ControllerConfig, ControllerEvent};
pub use decoder::Decoder;
pub use error::{DecodeError, EncodeError, SessionError};
pub use frame::{Frame, MAX_PAYLOAD};
pub use host::{Doubt, Host, HostConfig, HostEvent};
pub use instruction::{Class, ErrorCodes, Instruction, Instructions, Refusal, Words};
pub use message::{Item, Items, Payload, Values};
pub use profile::{ByteOrder, Flag, Profile, Tags, Tail, Width};
