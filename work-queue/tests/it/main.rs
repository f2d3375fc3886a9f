//! The integration tests of the crate, in one program: linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

#[cfg(all(feature = "alloc", not(loom)))]
mod batches;
#[cfg(all(feature = "alloc", not(loom)))]
mod drops;
#[cfg(all(feature = "alloc", not(loom)))]
mod ends;
#[cfg(not(loom))]
mod model;
#[cfg(all(feature = "alloc", not(loom)))]
mod queue;
#[cfg(all(feature = "alloc", not(loom)))]
mod strings;
