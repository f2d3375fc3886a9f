//! The integration tests of the crate, in one program: linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod common;
#[cfg(feature = "tokio")]
mod connectors;
#[cfg(feature = "contract")]
mod contract;
#[cfg(feature = "std")]
mod datagrams;
#[cfg(feature = "serialport")]
mod drivers;
mod echo;
#[cfg(all(feature = "embedded-io", feature = "embedded-io-async", feature = "std"))]
mod embedded;
mod end;
mod event_queue;
#[cfg(feature = "tokio")]
mod handle;
#[cfg(feature = "tokio")]
mod handle_ends;
#[cfg(feature = "tokio")]
mod handle_outcomes;
#[cfg(feature = "tokio")]
mod polls;
#[cfg(feature = "tokio")]
mod reporting;
#[cfg(feature = "serialport")]
mod serial;
#[cfg(feature = "tokio-tls")]
mod tls;
#[cfg(feature = "tokio")]
mod tokio;
