#![cfg_attr(any(not(doctest), feature = "tokio"), doc = include_str!("../README.md"))]
#![no_std]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

#[cfg(any(feature = "arbitrary", feature = "tokio"))]
extern crate std;

#[cfg(feature = "arbitrary")]
mod arbitrary;
pub mod controller;
mod decoder;
mod error;
mod frame;
pub mod host;
mod instruction;
mod items;
#[cfg(feature = "serde")]
mod json;
mod payload;
mod profile;
#[cfg(feature = "spec")]
mod spec;
pub mod timing;
#[cfg(feature = "tokio")]
pub mod tokio;
mod words;

pub use controller::{Controller, ControllerConfig, ControllerEvent, ControllerStatistics};
pub use decoder::Decoder;
pub use error::{ConfigError, DecodeError, EncodeError, SessionError, WordUse};
pub use frame::{Frame, MAX_PAYLOAD};
pub use host::machine::UnknownReason;
pub use host::{Host, HostConfig, HostEvent, HostStatistics};
pub use instruction::{Instruction, Instructions};
pub use items::{Item, Items, Number, Values};
pub use payload::Payload;
pub use profile::{ByteOrder, Flag, Profile, Tags, Tail, Width};
pub use robot_session;
pub use robot_work_queue;
pub use words::{Class, ErrorCodes, Refusal, Words};
