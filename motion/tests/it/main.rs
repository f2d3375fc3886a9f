//! The integration tests of the crate, in one program: linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod dpm;
mod evaluate;
mod kinematics;
mod limits;
mod orientation;
mod resample;
mod telemetry;
mod trajectory;
