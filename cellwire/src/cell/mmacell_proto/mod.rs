//! The pick-and-place task in the simulated cell.

pub mod cell;
pub mod central;
mod demo;
pub mod judged;
mod periphery;
mod settings;
pub mod timeline;
pub mod verdict;
pub mod workpiece;

pub use demo::demo;
pub use settings::Settings;
