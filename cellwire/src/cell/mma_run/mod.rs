//! Runs the pick-and-place task on the devices of an MM&A cell, each part once.

mod connection;
mod journal;
mod periphery;
mod run;
mod settings;

pub use journal::{Journal, State};
pub use periphery::{Line, Periphery, Simulated};
pub use run::{Addresses, Ended, Runner};
pub use settings::{Part, Settings};
