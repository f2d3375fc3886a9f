//! laser-eb90: its reference vectors, and both ends on a faulty line.

mod article;
mod bad_line;
mod cell;
#[path = "../../../../laser-eb90/tests/it/common/mod.rs"]
mod common;
mod session;
mod vectors;
