#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

pub mod decoder;
pub mod error;
pub mod frame;
pub mod instruction;
#[cfg(feature = "serde")]
mod json;
pub mod message;
pub mod profile;

pub use decoder::Decoder;
pub use error::{DecodeError, EncodeError, SessionError};
pub use frame::{Frame, MAX_PAYLOAD};
pub use instruction::{Class, ErrorCodes, Instruction, Instructions, Refusal, Words};
pub use message::{Item, Items, Payload, Values};
pub use profile::{ByteOrder, Flag, Profile, Tags, Tail, Width};
