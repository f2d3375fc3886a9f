//! The text messages between a Kawasaki robot and a PC.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod decoder;
mod dialect;
mod error;
mod job;
mod message;
mod number;
mod packet;
mod value;

pub use decoder::Decoder;
pub use dialect::{Dialect, Entry, Field, Params, Role};
pub use error::{ConfigError, DecodeError, EncodeError, MessageError, Name};
pub use job::{Bounds, Job, JobKind, Line, Point};
pub use message::Message;
pub use packet::{Limits, Packet, Room};
pub use value::{Charset, DATA, END, SEPARATOR, START, Value, Values};
