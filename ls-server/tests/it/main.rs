//! The server as an editor sees it: messages over pipes.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod client;
mod hostile;
mod protocol;
mod random;
