//! The typed messages inside a line.

mod command;
mod reply;

pub use command::{BLOW, Command, Mode, VACUUM};
pub use reply::{ErrorCode, Reply, Status};
