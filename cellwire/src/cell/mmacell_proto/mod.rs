//! The pick-and-place task in the simulated cell.

pub mod cell;
pub mod central;
mod demo;
mod judged;
mod periphery;
mod settings;
mod timeline;
mod verdict;
pub mod workpiece;

pub use demo::demo;
pub use settings::Settings;

#[cfg(test)]
mod virtual_clock;
