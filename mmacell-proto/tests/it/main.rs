//! The integration tests of the crate, in one program: linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

#[cfg(feature = "arbitrary")]
mod arbitrary;
mod central;
mod common;
#[cfg(feature = "std")]
mod device;
#[cfg(all(feature = "bytes", feature = "serde", feature = "tokio"))]
mod edges;
#[cfg(feature = "tokio")]
mod handle;
#[cfg(all(feature = "arbitrary", feature = "bytes"))]
mod properties;
