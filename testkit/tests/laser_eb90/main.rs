//! laser-eb90: its reference vectors, and both ends on a faulty line.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod article;
mod bad_line;
mod cell;
#[path = "../../../laser-eb90/tests/common/mod.rs"]
mod common;
mod refine;
mod session;
mod vectors;
