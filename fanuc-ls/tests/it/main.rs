//! The integration tests of the crate, in one program: linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

#[cfg(feature = "arbitrary")]
mod arbitrary;
mod document;
mod edges;
#[cfg(feature = "serde")]
mod findings;
mod grammar;
#[cfg(feature = "serde")]
mod mistakes;
mod numbers;
mod operations;
mod rewrite;
mod words;
