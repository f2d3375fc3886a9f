//! The pick-and-place task in the simulated cell.

pub mod cell;
pub mod central;
mod demo;
mod periphery;
mod timeline;
mod verdict;
pub mod workpiece;

pub use demo::{Settings, demo};

#[cfg(test)]
mod virtual_clock;
