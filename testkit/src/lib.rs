//! What the tests of every link share. Never published.
//!
//! - [`link`]: a link between two sessions on a virtual clock, with the faults that its transport can commit
//! - [`chunking`]: every way to cut a stream that a decoder must not notice
//! - [`vectors`]: the reader of `reference/vectors/<link>.json`

pub mod chunking;
pub mod link;
pub mod rng;
pub mod vectors;
