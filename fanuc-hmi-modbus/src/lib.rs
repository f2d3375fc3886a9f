#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

pub mod assignment;
pub mod block;
mod client;
pub mod crc;
mod decoder;
pub mod error;
mod frame;
mod framing;
mod line;
pub mod message;
mod model;
pub mod position;
mod registers;
mod server;
#[cfg(feature = "serde")]
mod shape;
mod signals;
pub mod text;
pub mod timing;
pub mod typed;

#[doc(no_inline)]
pub use assignment::Assignment;
pub use block::TelemetryBlock;
pub use client::{
    Client, ClientAction, ClientConfig, ClientEvent, ClientInput, ClientLink, ClientMachine,
    ClientStatistics, Failure, Held, Places, Quiet, Stage, Ticket,
};
pub use decoder::Decoder;
pub use error::{ConfigError, DecodeError, EncodeError, Mismatch, SessionError};
pub use frame::{Frame, Side};
pub use framing::{Framing, Framings, Rtu, Tcp};
pub use line::Line;
pub use message::{Bits, BitsMut, Exception, Pdu, PduBuf, Reply, Request, Words, WordsMut, function, limit};
#[cfg(feature = "model")]
#[doc(hidden)]
pub use model::Rule;
pub use position::PositionRegister;
pub use registers::{Registers, serve};
pub use robot_session;
pub use server::{
    Server, ServerAction, ServerConfig, ServerEvent, ServerInput, ServerLink, ServerMachine, ServerStatistics,
};
pub use signals::{Signal, Table};
pub use typed::{Multiply, WordOrder};
