//! mmacell-proto in the tool: its codec, the simulated cell, and the central controller that runs the task in it.

pub mod axes;
pub mod cell;
pub mod central;
mod codec;
mod connections;
mod demo;
mod periphery;
pub mod simulate;
pub mod station;
mod timeline;
mod verdict;
pub mod workpiece;

pub use codec::codec;
pub use demo::demo;

#[cfg(test)]
mod virtual_clock;
