//! The robot's end: the active side.

mod config;
mod event;
mod intake;
pub mod machine;
mod reading;
mod received;
mod session;
mod state;
mod transmit;

#[doc(hidden)]
pub use config::Rule;
pub use config::{Acks, RecoveryLimits, RobotConfig};
pub use event::RobotEvent;
pub use session::{LargeRobot, Robot};
pub use state::RecoveryStep;
