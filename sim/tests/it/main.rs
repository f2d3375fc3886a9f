//! The integration tests of the crate, in one program: linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod bench;
mod faults;
mod gadget;
mod host;
mod ledger;
#[cfg(unix)]
mod limits;
mod proxy;
mod running;
#[cfg(all(feature = "ball", feature = "laser", feature = "mma", feature = "puma", feature = "viewer"))]
mod settings;

#[cfg(feature = "ball")]
mod ball;
#[cfg(feature = "fanuc")]
mod fanuc;
#[cfg(feature = "kawasaki")]
mod kawasaki;
#[cfg(feature = "laser")]
mod laser;
#[cfg(feature = "mma")]
mod mma;
#[cfg(feature = "puma")]
mod puma;
#[cfg(feature = "tls")]
mod tls;
#[cfg(feature = "viewer")]
mod viewer;
