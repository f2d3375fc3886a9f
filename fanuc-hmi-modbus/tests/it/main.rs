//! The integration tests of the crate, in one program: linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

#[cfg(feature = "arbitrary")]
mod arbitrary;
mod client;
mod client_replies;
mod common;
mod decoder;
mod echo;
mod edges;
#[cfg(feature = "tokio")]
mod files;
#[cfg(feature = "tokio")]
mod handle;
mod identification;
mod line;
mod look_alikes;
#[cfg(feature = "tokio")]
mod pipes;
mod proof;
#[cfg(all(feature = "arbitrary", feature = "bytes"))]
mod properties;
mod receiver;
#[cfg(feature = "std")]
mod security;
mod server;
#[cfg(feature = "serde")]
mod shapes;
mod traced;
#[cfg(feature = "tokio")]
mod values;
