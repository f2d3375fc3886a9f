#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(any(test, feature = "tokio"))]
extern crate std;

#[cfg(feature = "tokio")]
mod codec;
mod decoder;
mod dialect;
mod error;
mod events;
mod job;
mod message;
mod number;
mod numbering;
mod packet;
mod pc;
mod plain;
mod robot;
pub mod state;
mod statistics;
pub mod timing;
mod value;

#[cfg(feature = "tokio")]
pub use codec::{Codec, Frame};
pub use decoder::Decoder;
pub use dialect::{Dialect, Entry, Field, Params, Role};
pub use error::{ConfigError, DecodeError, EncodeError, MessageError, Name, SessionError};
pub use job::{Bounds, Job, JobKind, Line, Point};
pub use message::Message;
pub use packet::{Limits, Packet, Room};
pub use pc::{JobSource, Pc, PcConfig, PcEvent, Supply, Takeover};
pub use robot::{Acks, Ladder, Robot, RobotConfig, RobotEvent, Rung};
pub use state::{Link, Phase};
pub use statistics::{Statistics, Times};
pub use value::{Charset, DATA, END, SEPARATOR, START, Value, Values};
