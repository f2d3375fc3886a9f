//! A program that the simulated controller runs: a test bench, not a controller.
//!
//! One task, one motion group of six axes, the calls beside it; `J`, `L`, `C` and `S` with CNT and FINE, registers, position and
//! string registers, inputs and outputs, timers, waits, jumps, conditions, loops. Other instructions are skipped, and reported
//! once at the start ([`Finding`]).

mod load;
mod machine;
mod memory;
mod position;
mod preset;

pub use load::{Finding, Macros, Programs, load, load_text};
pub use machine::Machine;
pub use memory::{Memory, Value};
pub use position::RobotPosition;
pub use preset::Preset;
