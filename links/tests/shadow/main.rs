//! Shadow ends, held against the session stories of the reference: whole, and each with one fault.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod faults;
mod middle;
mod stories;
mod told;
mod unseen;
