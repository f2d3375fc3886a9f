//! The integration tests of the crate, in one program: linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

#[cfg(feature = "arbitrary")]
mod arbitrary;
mod common;
mod controller;
#[cfg(all(feature = "bytes", feature = "serde"))]
mod edges;
mod envelope;
#[cfg(feature = "tokio")]
mod give_up;
#[cfg(feature = "tokio")]
mod handle;
mod host;
mod machine;
#[cfg(feature = "arbitrary")]
mod properties;
mod timing;
mod words;
