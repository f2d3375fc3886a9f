//! The forms of the data in `reference/`: written by its generator and by the tool, and checked.

pub mod field;
pub mod json;
pub mod story;
