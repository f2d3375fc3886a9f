//! The integration tests of the crate, in one program: linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

#[cfg(feature = "arbitrary")]
mod arbitrary;
mod dialect;
#[cfg(all(feature = "bytes", feature = "serde", feature = "tokio"))]
mod edges;
#[cfg(all(feature = "alloc", feature = "std"))]
mod examples;
#[cfg(feature = "tokio")]
mod give_up;
#[cfg(feature = "tokio")]
mod handle;
mod jobs;
mod layouts;
mod limits;
#[cfg(feature = "alloc")]
mod motion;
mod outcomes;
mod packet;
#[cfg(all(feature = "bytes", feature = "tokio"))]
mod properties;
#[cfg(feature = "alloc")]
mod resume;
#[cfg(feature = "tokio")]
mod robot_handle;
mod sizes;
#[cfg(feature = "tokio")]
mod tasks;
#[cfg(feature = "alloc")]
mod uart;
#[cfg(all(feature = "alloc", feature = "std"))]
mod wake;
