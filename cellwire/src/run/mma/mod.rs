//! Runs the pick-and-place task on the devices of an MM&A cell, each part once.

mod connection;
mod periphery;
mod run;
mod settings;
mod wire;

pub use periphery::{Line, Periphery, Simulated};
pub use run::{Addresses, Ended, Rest, Runner};
pub use settings::{Part, Settings};

use crate::io::journal::{self, Outcome};

/// The journal of a task: the outcome of each part. It is unknown from when the robot is sent to it until it is in its place, or
/// the operator has said so.
pub type Journal = journal::Journal<Vec<Outcome>>;
