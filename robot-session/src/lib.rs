#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "std")]
extern crate std;

mod buffer;
mod decoder;
mod encode;
mod event;
mod session;
mod settle;
#[cfg(feature = "std")]
mod std_driver;
#[cfg(feature = "tokio")]
pub mod tokio;
mod unexpected;

pub use buffer::StreamBuffer;
pub use decoder::Decoder;
pub use encode::Encode;
pub use event::EventQueue;
pub use session::Session;
pub use settle::{Output, settle};
#[cfg(feature = "std")]
pub use std_driver::{Driver, Ended, Received, Sent, Transport, drive, now};
pub use unexpected::Unexpected;
