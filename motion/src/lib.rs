//! Motion: kinematics, planning, recordings compared with plans, and an operator's latch.

mod bounds;
pub mod dpm;
mod evaluate;
mod inverse;
mod kinematics;
pub mod latch;
mod limits;
mod orientation;
mod planner;
pub mod plausibility;
mod resample;
mod spline;
mod tracker;
mod trajectory;

pub use bounds::{Bounds, Confidence};
pub use evaluate::{
    Delay, Deviation, Figures, State, Summary, compare, deviations, differentiate, fit_delay, moving,
};
pub use inverse::{Posture, Solution};
pub use kinematics::{Arm, Kinematics, Pose};
pub use limits::{Dimensions, JointLimits, LimitError, Limits, LimitsError};
pub use orientation::Quaternion;
pub use planner::{Goal, Move, MoveError, Pace, PathKind, Planner};
pub use resample::{Acceleration, Report, ResampleError, Resampling, Sampling, SpeedStep};
pub use tracker::{Counts, MotionSample, Observation, Tracker};
pub use trajectory::{JointSample, Trajectory, TrajectoryError, TrajectoryReason};
