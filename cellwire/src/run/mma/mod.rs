//! Runs the pick-and-place task on the devices of an MM&A cell, each part once.

mod connection;
mod periphery;
mod run;
mod settings;
mod wire;

pub use periphery::{Line, Periphery, PeripheryEvent, SimulatedPeriphery};
pub use run::{Addresses, FinalState, RunEnd, Runner};
pub use settings::{Part, Settings};

use crate::io::journal::{self, Outcome};

/// The journal of a task: the outcome of each part. The outcome is unknown from the time at which the robot is sent to the
/// part until the part is placed, or the operator has stated the outcome.
pub type Journal = journal::Journal<Vec<Outcome>>;
