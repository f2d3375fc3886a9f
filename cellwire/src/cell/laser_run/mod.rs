//! Runs a program on a laser robot: every instruction once, and what became of each is kept in a journal.

mod csv;
mod dxf;
mod gcode;
mod journal;
mod program;
mod route;
mod run;
mod settings;

pub use journal::{Journal, Outcome};
pub use program::Program;
pub use route::Instruction;
pub use run::{Ended, Runner};
pub use settings::{Coordinate, Mapping, Settings};
