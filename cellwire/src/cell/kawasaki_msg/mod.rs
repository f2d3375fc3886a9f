//! A PC that lets a robot draw a picture.

mod demo;
pub mod tally;

pub use demo::{Settings, demo};
