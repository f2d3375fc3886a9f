#![cfg_attr(any(not(doctest), feature = "tokio"), doc = include_str!("../README.md"))]
#![no_std]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

#[cfg(any(test, feature = "arbitrary", feature = "tokio"))]
extern crate std;

#[cfg(feature = "arbitrary")]
mod arbitrary;
mod content;
mod decoder;
mod dialect;
mod error;
mod frame;
mod job;
mod marks;
mod message;
pub mod motion;
mod number;
mod numbering;
mod packet;
mod params;
pub mod pc;
mod phase;
pub mod robot;
mod role;
#[cfg(feature = "spec")]
mod spec;
mod statistics;
mod text;
pub mod timing;
#[cfg(feature = "tokio")]
pub mod tokio;
mod value;
mod writer;

pub use content::{FromPc, FromRobot, Status};
pub use decoder::Decoder;
pub use dialect::{Dialect, Entry};
pub use error::{ConfigError, DecodeError, EncodeError, FieldError, FieldFault, MessageError, SessionError};
pub use job::{Bounds, FieldVisitor, Job, JobKind, Line, Point, Unfit, VisitResult, Work};
pub use marks::{DATA, END, SEPARATOR, START};
pub use message::Message;
pub use number::Decimal;
pub use numbering::{AheadJobs, Numbering};
pub use packet::{AddResult, Limits, Packet};
pub use params::Params;
pub use pc::{CommandOutcome, JobSource, LargePc, Pc, PcConfig, PcEvent, Supply, Takeover};
pub use phase::Phase;
pub use robot::{Acks, LargeRobot, RecoveryLimits, RecoveryStep, Robot, RobotConfig, RobotEvent};
pub use robot_session;
pub use robot_work_queue;
pub use role::{Field, Role};
pub use statistics::{PcStatistics, RobotStatistics, Times};
pub use text::{Name, Text};
pub use value::{Charset, Value, Values};
pub use writer::Writer;
