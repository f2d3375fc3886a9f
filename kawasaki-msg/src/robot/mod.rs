//! The robot's end: the active side.

mod config;
mod event;
mod intake;
mod machine;
mod reading;
mod session;
mod state;
mod transmit;

#[doc(hidden)]
pub use config::Rule;
pub use config::{Acks, Config, RecoveryLimits, RobotConfig};
pub use event::RobotEvent;
pub use session::{LargeRobot, Robot};
pub use state::{
    AckState, Action, Cycle, Ended, Flow, Gap, Input, Link, Machine, Order, Recovery, RecoveryStep,
    Rejection, Replies, Report, Sent, Stage, Starts,
};
