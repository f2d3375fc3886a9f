//! A laser robot that cuts a sheet.

mod demo;
pub mod host;
pub mod path;
pub mod tally;

pub use demo::{Settings, demo};
