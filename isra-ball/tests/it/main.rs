//! The integration tests of the crate, in one program: linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod age;
#[cfg(feature = "arbitrary")]
mod arbitrary;
#[cfg(feature = "bytes")]
mod edges;
#[cfg(feature = "tokio")]
mod handle;
#[cfg(all(feature = "arbitrary", feature = "bytes"))]
mod properties;
mod session;
