#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

mod attribute;
mod builder;
mod error;
mod instruction;
mod motion;
mod position;
mod program;
mod text;

pub use attribute::{Attribute, AttributeValue};
pub use builder::Builder;
pub use error::{DecodeError, EncodeError, Reason, Warning};
pub use instruction::Instruction;
pub use motion::{Motion, MotionKind, Speed, SpeedUnit, Target, Termination};
pub use position::{Axis, AxisName, AxisUnit, Configuration, Group, Position};
pub use program::{COMMENT_LENGTH, CommentRule, Program, Rules};
