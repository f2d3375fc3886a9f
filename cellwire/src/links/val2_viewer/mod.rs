//! val2-viewer in the tool: its codec, and the simulated graphics workstation.

mod codec;
mod demo;
pub mod workstation;

pub use codec::codec;
pub use demo::demo;
