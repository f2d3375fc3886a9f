#![cfg_attr(any(not(doctest), feature = "tokio"), doc = include_str!("../README.md"))]
#![no_std]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

#[cfg(any(feature = "arbitrary", feature = "tokio"))]
extern crate std;

#[cfg(feature = "arbitrary")]
mod arbitrary;
pub mod assignment;
pub mod block;
pub mod client;
pub mod crc;
mod decoder;
mod error;
mod frame;
mod framing;
mod line;
#[cfg(feature = "tokio")]
mod many;
mod message;
pub mod position;
mod registers;
pub mod security;
pub mod server;
#[cfg(feature = "serde")]
mod shape;
mod signals;
#[cfg(feature = "spec")]
mod spec;
mod stream;
pub mod text;
pub mod timing;
#[cfg(feature = "tokio")]
pub mod tokio;
pub mod typed;

#[doc(no_inline)]
pub use assignment::Assignment;
pub use block::TelemetryBlock;
pub use client::{Client, ClientConfig, ClientEvent, ClientStatistics, Failure, Ticket};
pub use decoder::Decoder;
pub use error::{ConfigError, DecodeError, EncodeError, Mismatch, SessionError};
pub use frame::{Frame, Side};
pub use framing::Framing;
pub use message::{
    Bits, BitsMut, DeviceIdentification, DeviceObjects, Exception, FileRange, FileRecord, Pdu, PduBuf,
    Records, Reply, Request, Words, WordsMut, function, limit,
};
pub use position::PositionRegister;
pub use registers::{CommEvents, Registers, serve};
pub use robot_session;
pub use server::{Server, ServerConfig, ServerEvent, ServerStatistics};
#[cfg(feature = "serde")]
#[doc(hidden)]
pub use shape::FrameObject;
pub use signals::{Signal, Table};
pub use typed::{Multiply, WordOrder};
