//! isra-ball in the tool: its codec, the simulated ball and the hand on it.

pub mod ball;
mod codec;
mod demo;
pub mod hand;

pub use codec::codec;
pub use demo::demo;
