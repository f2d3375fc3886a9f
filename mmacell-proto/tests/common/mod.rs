//! Helpers of the tests.

pub mod sessions;
pub mod tasks;
