//! Motion: where an arm is, what a recording shows of it, and how far it was from the plan.

pub mod dpm;
mod evaluate;
mod kinematics;
mod limits;
mod orientation;
mod resample;
mod tracker;
mod trajectory;

pub use evaluate::{Deviation, Figures, State, Summary, deviations, differentiate, fit_delay};
pub use kinematics::{Arm, Kinematics, Pose};
pub use limits::{JointLimits, LimitError, Limits, LimitsError};
pub use orientation::Quaternion;
pub use resample::{Acceleration, Report, ResampleError, Resampling, Sampling, SpeedStep};
pub use tracker::{Counts, MotionSample, Observation, Tracker};
pub use trajectory::{JointSample, Trajectory, TrajectoryError, TrajectoryReason};
