#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

mod attribute;
mod background;
mod builder;
mod error;
mod instruction;
mod kinematics;
mod motion;
mod position;
mod program;
mod resample;
mod text;
mod trajectory;

pub use attribute::{Attribute, AttributeValue};
pub use background::BackgroundTask;
pub use builder::Builder;
pub use error::{DecodeError, EncodeError, Reason, Warning};
pub use instruction::Instruction;
pub use kinematics::{Arm, Kinematics, Pose};
pub use motion::{Motion, MotionKind, Speed, SpeedUnit, Target, Termination};
pub use position::{Axis, AxisName, AxisUnit, Configuration, Group, Position};
pub use program::{COMMENT_LENGTH, CommentRule, Program, Rules};
pub use resample::{Acceleration, Report, ResampleError, Resampling, Sampling, SpeedStep};
pub use trajectory::{Sample, Trajectory, TrajectoryError, TrajectoryReason};
