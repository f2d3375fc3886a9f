#![cfg_attr(any(not(doctest), all(feature = "embedded-io", feature = "std")), doc = include_str!("../README.md"))]
#![no_std]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

#[cfg(any(feature = "model", feature = "settings", feature = "std"))]
extern crate std;

mod buffer;
mod bytes;
#[cfg(feature = "contract")]
pub mod contract;
mod counters;
mod decoder;
mod echo;
#[cfg(feature = "embedded-io")]
pub mod embedded_io;
#[cfg(feature = "embedded-io-async")]
pub mod embedded_io_async;
mod encode;
pub mod end;
#[cfg(any(feature = "std", feature = "embedded-io", feature = "embedded-io-async"))]
mod end_reason;
mod event;
mod machine;
#[cfg(any(feature = "std", feature = "embedded-io", feature = "embedded-io-async"))]
mod pending;
mod rules;
#[cfg(feature = "serialport")]
mod serial;
mod session;
#[cfg(feature = "settings")]
pub mod settings;
#[cfg(feature = "spec")]
pub mod spec;
#[cfg(feature = "std")]
mod std_driver;
mod step;
#[cfg(feature = "tls")]
pub mod tls;
#[cfg(feature = "tokio")]
pub mod tokio;
mod trace;
#[cfg(any(feature = "tokio", feature = "embedded-io", feature = "embedded-io-async"))]
mod turn;
#[cfg(feature = "serde")]
pub mod under;
mod unexpected;
#[cfg(feature = "std")]
mod wait;

pub use decoder::Decoder;
pub use echo::EchoError;
pub use encode::Encode;
#[cfg(any(feature = "std", feature = "embedded-io", feature = "embedded-io-async"))]
pub use end_reason::{EndReason, STALL};
#[cfg(feature = "serialport")]
pub use serial::Serial;
#[cfg(feature = "serialport")]
pub use serialport;
pub use session::Session;
#[cfg(feature = "std")]
pub use std_driver::{
    Driver, ReceiveOutcome, SendOutcome, Transport, discard_unacknowledged, drive, is_lost_datagram,
    is_silence, is_unsendable, now,
};
pub use step::{Step, Steps};
#[cfg(any(feature = "tokio", feature = "embedded-io", feature = "embedded-io-async"))]
pub use turn::Clock;
pub use unexpected::Unexpected;
#[cfg(feature = "std")]
pub use wait::{Wait, Waker};
