//! All tests of the crate from without, in one program: they are linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod kinematics;
mod telemetry;
