//! Runs a program on a laser robot: every instruction once, with the outcome of each in a journal.

mod csv;
mod gcode;
mod program;
mod route;
mod run;
mod settings;
mod svg;

pub use program::Program;
pub use route::{Instruction, Route};
pub use run::{RunEnd, Runner};
pub use settings::{Coordinate, Mapping, Settings};

use crate::io::journal::{self, Outcome};

/// The journal of a program: the outcome of each instruction. An instruction is done if the controller has queued it, or
/// executed it if it is immediate.
pub type Journal = journal::Journal<Vec<Outcome>>;
