//! The integration tests of the crate, in one program: linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

#[cfg(feature = "arbitrary")]
mod arbitrary;
#[cfg(all(feature = "bytes", feature = "serde"))]
mod edges;
mod exchange;
#[cfg(feature = "tokio")]
mod handle;
#[cfg(all(feature = "arbitrary", feature = "bytes"))]
mod properties;
mod rules;
mod session;
mod stream;
