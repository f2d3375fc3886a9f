//! VAL II ALTER: both ends on one line.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod common;
mod motion;
mod refine;
mod session;
