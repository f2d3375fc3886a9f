#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "tokio")]
extern crate std;

pub mod assignment;
pub mod block;
pub mod client;
#[cfg(feature = "tokio")]
mod codec;
pub mod crc;
mod decoder;
pub mod dpm;
pub mod error;
pub mod evaluate;
mod frame;
pub mod message;
mod orientation;
mod registers;
pub mod server;
mod signals;
pub mod state;
pub mod telemetry;
pub mod timing;
pub mod typed;

pub use assignment::Assignment;
pub use block::TelemetryBlock;
pub use client::Client;
#[cfg(feature = "tokio")]
pub use codec::Codec;
pub use decoder::{Decoder, Framing};
pub use error::{DecodeError, EncodeError, Mismatch, SessionError};
pub use frame::{Frame, Side};
pub use message::{Bits, BitsMut, Exception, Pdu, PduBuf, Reply, Request, Words, WordsMut, function, limit};
pub use orientation::Quaternion;
pub use registers::{Registers, serve};
pub use server::Server;
pub use signals::{Signal, Table};
pub use typed::{Multiply, WordOrder};
